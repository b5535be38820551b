// The cloud of points, one scan at a time.
"use strict";
const run = JSON.parse(document.getElementById("run").textContent);
const tabs = document.getElementById("tabs");

function show(index) {
  [...tabs.children].forEach((tab, i) => tab.setAttribute("aria-selected", String(i === index)));
  const scan = run.scans[index];
  const points = (inferred, size, name) => {
    const chosen = scan.points.filter((_, i) => scan.inferred[i] === inferred);
    return {
      type: "scatter3d", mode: "markers", name, showlegend: false,
      x: chosen.map((p) => p[0]), y: chosen.map((p) => p[1]), z: chosen.map((p) => p[2]),
      marker: {
        size, color: chosen.map((p) => p[2]), colorscale: run.colours.heights,
        cmin: scan.range_mm[0], cmax: scan.range_mm[1], line: { color: "#fff", width: 0.5 },
        colorbar: inferred ? undefined : { title: { text: `${scan.above} (mm)` }, thickness: 14, len: 0.7 },
      },
      hovertemplate: `x %{x:.0f}, y %{y:.0f}: %{z:.1f} mm ${scan.above}<extra>${name}</extra>`,
    };
  };
  const traces = [points(false, 6, "touched"), points(true, 3, "inferred")];
  if (scan.truth) {
    const step = scan.truth.step_mm;
    const line = { x: [], y: [], z: [] };
    const add = (i, j) => {
      line.x.push(j * step); line.y.push(i * step); line.z.push(scan.truth.height_mm[i][j]);
    };
    const rows = scan.truth.height_mm.length, columns = rows ? scan.truth.height_mm[0].length : 0;
    const gap = () => { line.x.push(null); line.y.push(null); line.z.push(null); };
    // A finer net would hide the points.
    const every = 2;
    for (let i = 0; i < rows; i += every) { for (let j = 0; j < columns; j++) add(i, j); gap(); }
    for (let j = 0; j < columns; j += every) { for (let i = 0; i < rows; i++) add(i, j); gap(); }
    traces.push({
      type: "scatter3d", mode: "lines", ...line, connectgaps: false, hoverinfo: "skip", showlegend: false,
      line: { color: "#8a96a3", width: 2 },
    });
  }
  // The longest side is 1, so that the camera has all of it in view.
  const sides_mm = [...scan.size_mm, scan.range_mm[1] + 5], longest_mm = Math.max(...sides_mm);
  const axis = (text, range) => ({ title: { text }, range, gridcolor: run.colours.grid, backgroundcolor: "#fbfcfd", showbackground: true });
  Plotly.react("cloud", traces, {
    margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: "rgba(0,0,0,0)",
    font: { family: "system-ui, sans-serif", size: 13, color: run.colours.ink },
    scene: {
      aspectmode: "manual",
      aspectratio: { x: sides_mm[0] / longest_mm, y: sides_mm[1] / longest_mm, z: sides_mm[2] / longest_mm },
      xaxis: axis("x (mm)", [0, scan.size_mm[0]]), yaxis: axis("y (mm)", [0, scan.size_mm[1]]),
      zaxis: { ...axis("z (mm)", [0, sides_mm[2]]), nticks: 3 },
      camera: { eye: { x: -0.85, y: -1.3, z: 0.9 } },
    },
  }, { responsive: true, displaylogo: false, displayModeBar: false });
}

run.scans.forEach((scan, index) => {
  const tab = document.createElement("button");
  tab.setAttribute("role", "tab");
  tab.textContent = scan.mode;
  tab.addEventListener("click", () => show(index));
  tabs.append(tab);
});
if (run.scans.length) show(0);
