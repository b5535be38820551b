// The map of targets: one bending plane of one run at a time.
"use strict";
const run = JSON.parse(document.getElementById("run").textContent);
const tabs = document.getElementById("tabs");
const views = [];
for (const one of run.runs) {
  for (const plane of ["X", "Y"]) {
    if (one.poses.some((pose) => pose.plane === plane)) views.push({ one, plane });
  }
}

function show(index) {
  const { one, plane } = views[index];
  [...tabs.children].forEach((tab, i) => tab.setAttribute("aria-selected", String(i === index)));
  const poses = one.poses.filter((pose) => pose.plane === plane || (plane === "X" && pose.straight));
  const lines = { x: [], y: [] };
  for (const pose of poses) {
    lines.x.push(pose.target[0], pose.found[0], null);
    lines.y.push(pose.target[1], pose.found[1], null);
  }
  const text = poses.map((pose) => `<b>${pose.label}</b><br>error ${pose.error.toFixed(2)} mm` +
    `<br>${plane.toLowerCase()} ${(pose.found[0] - pose.target[0]).toFixed(2)}, z ${(pose.found[1] - pose.target[1]).toFixed(2)}` +
    (pose.held ? "" : "<br>tendons that only pull can’t hold it"));
  const marks = (place, marker) => ({
    type: "scatter", mode: "markers", x: poses.map((p) => p[place][0]), y: poses.map((p) => p[place][1]),
    marker, text, hovertemplate: "%{text}<extra></extra>", showlegend: false,
  });
  Plotly.react("map", [
    { type: "scatter", mode: "lines", x: lines.x, y: lines.y, line: { color: run.colours.line, width: 1.6 }, hoverinfo: "skip", showlegend: false },
    marks("found", {
      size: 8, color: poses.map((p) => p.error), cmin: 0, cmax: run.most,
      colorscale: run.colours.errors, colorbar: { title: { text: "error (mm)" }, thickness: 14 },
    }),
    marks("target", {
      size: 12, symbol: poses.map((p) => (p.held ? "circle-open" : "circle-open-dot")),
      color: run.colours.ink, line: { width: 1.4 },
    }),
  ], {
    margin: { l: 60, r: 20, t: 20, b: 64 }, paper_bgcolor: "rgba(0,0,0,0)", hovermode: "closest",
    font: { family: "system-ui, sans-serif", size: 14, color: run.colours.ink },
    xaxis: { title: { text: `${plane.toLowerCase()} (mm)` }, zeroline: false, gridcolor: run.colours.grid },
    yaxis: { title: { text: "z (mm)" }, zeroline: false, scaleanchor: "x", gridcolor: run.colours.grid },
  }, { responsive: true, displaylogo: false, displayModeBar: false });
}

views.forEach(({ one, plane }, index) => {
  const tab = document.createElement("button");
  tab.setAttribute("role", "tab");
  tab.textContent = `${one.model}, plane of ${plane} and Z`;
  tab.addEventListener("click", () => show(index));
  tabs.append(tab);
});
document.getElementById("key").innerHTML =
  "<span>○ target</span><span>⊙ target that needs a tendon that pushes</span><span>● where the robot came to</span>";
if (views.length) show(0);
