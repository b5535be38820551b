"use strict";
(() => {
const data = JSON.parse(document.getElementById("data").textContent);
const $ = (id) => document.getElementById(id);
const rgb = (text) => [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16));
const light = [0.35, -0.55, 0.76];

// Shades are worked out here: Plotly's own light fails in a parallel projection.
function shade(colour, q) {
  const a = [0, 1, 2].map((k) => q[6 + k] - q[k]), b = [0, 1, 2].map((k) => q[9 + k] - q[3 + k]);
  const n = [a[1]*b[2] - a[2]*b[1], a[2]*b[0] - a[0]*b[2], a[0]*b[1] - a[1]*b[0]];
  const lit = Math.abs(n[0]*light[0] + n[1]*light[1] + n[2]*light[2]) / (Math.hypot(...n) || 1);
  const to = lit > 0.6 ? [255, 255, 255] : [31, 41, 51], share = lit > 0.6 ? 0.5 * (lit - 0.6) : 0.22 * (0.6 - lit);
  return `rgb(${rgb(colour).map((v, i) => Math.round(v + (to[i] - v) * share)).join(",")})`;
}
function mesh(body, visible) {
  const x = [], y = [], z = [], i = [], j = [], k = [], facecolor = [];
  body.quads.forEach((q, n) => {
    const at = x.length, colour = shade(data.colours[+body.kinds[n]], q);
    for (let c = 0; c < 4; c++) { x.push(q[3*c]); y.push(q[3*c+1]); z.push(q[3*c+2]); }
    i.push(at, at); j.push(at + 1, at + 2); k.push(at + 2, at + 3); facecolor.push(colour, colour);
  });
  return { type: "mesh3d", x, y, z, i, j, k, facecolor, visible, hoverinfo: "skip",
    lighting: { ambient: 1, diffuse: 0, specular: 0 }, flatshading: true };
}
const range = [0, 1, 2].map((k) => {
  let low = Infinity, high = -Infinity;
  for (const q of data.bodies[0].quads) for (let c = k; c < 12; c += 3) { low = Math.min(low, q[c]); high = Math.max(high, q[c]); }
  return [low - 2, high + 2];
});
const size = range.map(([a, b]) => b - a), scale = 1.5 / Math.max(...size);
const axis = (text, k) => ({ title: { text }, range: range[k], gridcolor: "#dde4ea", zeroline: false, backgroundcolor: "#fff",
  tickfont: { size: 12, color: data.muted } });
Plotly.newPlot($("scene"), data.bodies.map((body, n) => mesh(body, n === 0)), {
  margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: "rgba(0,0,0,0)", showlegend: false,
  font: { family: "system-ui, sans-serif", color: data.ink },
  scene: { xaxis: axis("x (mm)", 0), yaxis: axis("y (mm)", 1), zaxis: axis("z (mm)", 2), aspectmode: "manual",
    aspectratio: { x: size[0]*scale, y: size[1]*scale, z: size[2]*scale }, dragmode: "turntable",
    camera: { eye: { x: 1.4, y: -1.4, z: 0.75 }, center: { x: 0, y: 0, z: -0.12 } } },
}, { displaylogo: false, responsive: true, displayModeBar: false });

data.bodies.forEach((body, n) => {
  const tab = document.createElement("button");
  tab.setAttribute("role", "tab"); tab.textContent = body.name; tab.setAttribute("aria-selected", String(n === 0));
  tab.onclick = () => {
    document.querySelectorAll("#tabs button").forEach((b) => b.setAttribute("aria-selected", String(b === tab)));
    Plotly.restyle($("scene"), { visible: data.bodies.map((_, m) => m === n) });
  };
  $("tabs").append(tab);
});
$("key").innerHTML = data.shown.map((kind) => `<span><i style="background:${data.colours[kind]}"></i>${data.names[kind]}</span>`).join("");

// -------------------------------------------------------------------- sections
const canvas = $("cut"), pen = canvas.getContext("2d"), corners = data.corners;
const rows = corners.length - 1, columns = corners[0].length - 1, count = data.sections.length;
let far = 0, low = Infinity, high = -Infinity;
for (const row of corners) for (const [x, z] of row) { far = Math.max(far, x); low = Math.min(low, z); high = Math.max(high, z); }
const unit = Math.min((canvas.width - 160) / (2 * far), (canvas.height - 130) / (high - Math.min(low, 0)));
const px = (x) => canvas.width / 2 + x * unit, py = (z) => canvas.height - 80 - (z - Math.min(low, 0)) * unit;
function half(fates, side) {
  for (let r = 0; r < rows; r++) for (let c = 0; c < columns; c++) {
    pen.fillStyle = pen.strokeStyle = data.colours[+fates[r * columns + c]];
    pen.beginPath();
    for (const [x, z] of [corners[r][c], corners[r+1][c], corners[r+1][c+1], corners[r][c+1]]) pen.lineTo(px(side * x), py(z));
    pen.closePath(); pen.fill(); pen.stroke();
  }
}
function draw(index) {
  const degrees = index * data.step_deg;
  pen.clearRect(0, 0, canvas.width, canvas.height);
  pen.lineWidth = 0.8;
  half(data.sections[index], 1);
  half(data.sections[(index + count / 2) % count], -1);
  pen.fillStyle = data.muted; pen.strokeStyle = "#c5ced6"; pen.lineWidth = 1; pen.textAlign = "center";
  pen.font = "22px system-ui, sans-serif";
  for (let x = -Math.floor(far / 10) * 10; x <= far; x += 10) {
    pen.beginPath(); pen.moveTo(px(x), py(Math.min(low, 0)) + 4); pen.lineTo(px(x), py(Math.min(low, 0)) + 12); pen.stroke();
    pen.fillText(String(x), px(x), py(Math.min(low, 0)) + 36);
  }
  pen.textAlign = "right";
  for (let z = Math.ceil(Math.min(low, 0) / 10) * 10; z <= high; z += 10) pen.fillText(String(z), px(-far) - 16, py(z) + 7);
  pen.textAlign = "center";
  pen.fillText("distance from the axis (mm), z upwards (mm)", canvas.width / 2, canvas.height - 12);
  pen.fillText(`α = ${(degrees + 180) % 360}°`, px(-far * 0.8), py(high) + 10);
  pen.fillText(`α = ${degrees}°`, px(far * 0.8), py(high) + 10);
  $("degrees").textContent = `${degrees}° and ${(degrees + 180) % 360}°`;
}
$("angle").max = String(count - 1);
$("angle").oninput = (event) => draw(+event.target.value);
draw(0);
})();
