"use strict";
(() => {
const run = JSON.parse(document.getElementById("run").textContent);
const colour = run.colours;
const $ = (id) => document.getElementById(id);
const unpack = (text, Kind) => {
  const raw = atob(text), bytes = new Uint8Array(raw.length);
  for (let i = 0; i < raw.length; i++) bytes[i] = raw.charCodeAt(i);
  return new Kind(bytes.buffer);
};
for (const trial of run.trials) {
  if (trial.motion) {
    trial.motion.time = unpack(trial.motion.time_s, Float32Array);
    trial.motion.points = unpack(trial.motion.points, Int16Array);
  }
  trial.pressure.time = unpack(trial.pressure.time_s, Float32Array);
  trial.pressure.value = unpack(trial.pressure.change_hpa, Float32Array);
  trial.pressure.base = unpack(trial.pressure.baseline_hpa, Float32Array);
}

// ------------------------------------------------------------------- vectors
const add = (a, b, s = 1) => [a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]];
const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
const cross = (a, b) => [a[1]*b[2] - a[2]*b[1], a[2]*b[0] - a[0]*b[2], a[0]*b[1] - a[1]*b[0]];
const unit = (a) => { const n = Math.hypot(...a) || 1; return [a[0]/n, a[1]/n, a[2]/n]; };
const mixed = (a, b, s) => [a[0] + (b[0]-a[0])*s, a[1] + (b[1]-a[1])*s, a[2] + (b[2]-a[2])*s];
const columns = (points) => ({
  x: points.map((p) => p && p[0]), y: points.map((p) => p && p[1]), z: points.map((p) => p && p[2]),
});
const indexBefore = (times, t) => {
  let low = 0, high = times.length - 1;
  while (low < high) { const mid = (low + high + 1) >> 1; if (times[mid] <= t) low = mid; else high = mid - 1; }
  return low;
};

// The robot's shape at a time: straight between two stored samples.
function shapeAt(motion, t) {
  const i = Math.min(indexBefore(motion.time, t), motion.time.length - 2);
  const s = Math.min(Math.max((t - motion.time[i]) / (motion.time[i+1] - motion.time[i] || 1), 0), 1);
  const count = motion.per_frame, at = [];
  for (let k = 0; k < count; k++) {
    const a = 3 * (i * count + k), b = a + 3 * count, point = [0, 0, 0];
    for (let c = 0; c < 3; c++)
      point[c] = ((1 - s) * motion.points[a+c] + s * motion.points[b+c]) * motion.step_mm;
    at.push(point);
  }
  return { arm: at[0], filament: [at[1], at[2]], backbone: at.slice(3) };
}

// Directions beside a curve that do not twist about it; `first` is x at the base.
function framesOf(curve) {
  let axis = [1, 0, 0];
  return curve.map((_, i) => {
    const a = curve[Math.max(i - 1, 0)], b = curve[Math.min(i + 1, curve.length - 1)];
    const along = unit(add(b, a, -1));
    axis = unit(add(axis, along, -dot(axis, along)));
    return { along, first: axis, second: cross(along, axis) };
  });
}
const onCurve = (list, s) => {
  const x = s * (list.length - 1), i = Math.min(Math.floor(x), list.length - 2);
  return [list[i], list[i + 1], x - i];
};

// ------------------------------------------------------------------- surfaces
const SIDES = 7, STEPS_PER_COIL = 18, COILS = run.robot.coils;
function springWire(backbone, frames) {
  const centre = [], n = COILS * STEPS_PER_COIL;
  for (let k = 0; k <= n; k++) {
    const s = k / n, angle = 2 * Math.PI * COILS * s;
    const [p, q, f] = onCurve(backbone, s), [g, h] = onCurve(frames, s);
    const first = mixed(g.first, h.first, f), second = mixed(g.second, h.second, f);
    centre.push(add(add(mixed(p, q, f), first, run.robot.spring_radius_mm * Math.cos(angle)),
                    second, run.robot.spring_radius_mm * Math.sin(angle)));
  }
  return centre;
}
function pipe(centre, radius) {
  const points = [];
  let axis = unit(cross(add(centre[1], centre[0], -1), [0.3, 0.2, 1]));
  centre.forEach((p, i) => {
    const along = unit(add(centre[Math.min(i+1, centre.length-1)], centre[Math.max(i-1, 0)], -1));
    axis = unit(add(axis, along, -dot(axis, along)));
    const side = cross(along, axis);
    for (let k = 0; k < SIDES; k++) {
      const a = 2 * Math.PI * k / SIDES;
      points.push(add(add(p, axis, radius * Math.cos(a)), side, radius * Math.sin(a)));
    }
  });
  return points;
}
function pipeFaces(rows, sides) {
  const i = [], j = [], k = [];
  for (let r = 0; r < rows - 1; r++) for (let c = 0; c < sides; c++) {
    const a = r * sides + c, b = r * sides + (c + 1) % sides, d = a + sides, e = b + sides;
    i.push(a, b); j.push(b, e); k.push(d, d);
  }
  return { i, j, k };
}
const ROUND = 32;
// A body of revolution: rings given as [centre, radius], flat caps at both ends.
function turned(rings, first, second) {
  return rings.flatMap(([centre, radius]) => Array.from({ length: ROUND }, (_, c) => {
    const a = 2 * Math.PI * c / ROUND;
    return add(add(centre, first, radius * Math.cos(a)), second, radius * Math.sin(a));
  }));
}
function holderPoints(arm) {
  const h = run.robot.holder_height_mm, r = run.robot.holder_radius_mm, e = 0.01;
  const at = (z, radius) => [add(arm, [0, 0, z]), radius];
  return turned([at(0, e), at(0, r - 2), at(2, r), at(h - 2, r), at(h, r - 2), at(h, 0.62 * r),
                 at(h + 26, 0.62 * r), at(h + 26, e)], [1, 0, 0], [0, 1, 0]);
}
function capPoints(shape, frames) {
  const end = frames[frames.length - 1], top = shape.backbone[shape.backbone.length - 1];
  const r = run.robot.spring_radius_mm + 1.2, e = 0.01;
  const at = (z, radius) => [add(top, end.along, z), radius];
  return turned([at(-1.5, e), at(-1.5, r), at(2.0, r), at(2.6, r - 0.6), at(2.6, e)], end.first, end.second);
}
function siliconePoints(shape, frames) {
  const end = frames[frames.length - 1], top = shape.backbone[shape.backbone.length - 1];
  const reach = Math.max(Math.hypot(...add(shape.filament[0], top, -1)), 5), e = 0.01;
  const at = (z, radius) => [add(top, end.along, z), radius];
  return turned([at(2.6, 5), at(reach * 0.6, 4.6), at(reach * 0.85, 3.4), at(reach, 1.6), at(reach, e)], end.first, end.second);
}

// ---------------------------------------------------------------------- scene
// Shades are worked out here, once for each mesh: Plotly's own light fails in a
// parallel projection, which keeps the picture to scale.
const eyeAt = [Math.cos(run.view_rad), Math.sin(run.view_rad), 0];
const sun = unit(add(add(eyeAt, cross([0, 0, 1], eyeAt), -0.75), [0, 0, 1], 0.9));
const rgb = (text) => [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16));
const tint = (tone, normal, depth) => {
  const lit = dot(normal, sun), c = rgb(tone);
  const to = lit > 0.55 ? [255, 255, 255] : [31, 41, 51];
  const share = lit > 0.55 ? 0.75 * (lit - 0.55) : depth * (0.55 - lit);
  return `rgb(${c.map((v, i) => Math.round(v + (to[i] - v) * share)).join(",")})`;
};
const faceNormals = (points, f) => f.i.map((_, n) =>
  cross(add(points[f.j[n]], points[f.i[n]], -1), add(points[f.k[n]], points[f.i[n]], -1)));
function shaded(points, faces, tone, { flat = false, depth = 0.3, outward = null } = {}) {
  const normals = faceNormals(points, faces), sign = outward ? outward : () => 1;
  if (flat) return { facecolor: normals.map((n, i) => tint(tone, unit(mixed([0, 0, 0], n, sign(n, points[faces.i[i]]))), depth)) };
  const sums = points.map(() => [0, 0, 0]);
  normals.forEach((n, t) => { for (const key of ["i", "j", "k"]) sums[faces[key][t]] = add(sums[faces[key][t]], n); });
  return { vertexcolor: sums.map((n, i) => tint(tone, unit(mixed([0, 0, 0], n, sign(n, points[i]))), depth)) };
}
const even = { ambient: 1, diffuse: 0, specular: 0, roughness: 1, fresnel: 0 };
const mesh = (points, faces, tone, how, more = {}) => ({
  type: "mesh3d", ...columns(points), ...faces, ...shaded(points, faces, tone, how), hoverinfo: "skip",
  lighting: even, showlegend: false, ...more,
});
const line = (points, tone, width, more = {}) => ({
  type: "scatter3d", mode: "lines", ...columns(points), line: { color: tone, width },
  hoverinfo: "skip", showlegend: false, ...more,
});

function tubeTraces(tube, floor) {
  if (!tube) return [];
  const towards = Math.atan2(-tube.axis_mm[1], -tube.axis_mm[0]), n = 72, top = 10;
  const point = (s, z) => {
    const [from, to] = run.wall_deg, a = towards + (from + (to - from) * s) * Math.PI / 180;
    return [tube.axis_mm[0] + tube.inner_radius_mm * Math.cos(a), tube.axis_mm[1] + tube.inner_radius_mm * Math.sin(a), z];
  };
  const arc = (z) => Array.from({ length: n + 1 }, (_, k) => point(k / n, z));
  const low = arc(floor), high = arc(top), faces = { i: [], j: [], k: [] };
  for (let k = 0; k < n; k++) {
    faces.i.push(k, k + 1); faces.j.push(k + 1, k + n + 2); faces.k.push(k + n + 1, k + n + 1);
  }
  const inwards = (n, p) => Math.sign(n[0] * (tube.axis_mm[0] - p[0]) + n[1] * (tube.axis_mm[1] - p[1]));
  const rings = [];
  for (let z = Math.ceil(floor / 20) * 20; z < top; z += 20) rings.push(...arc(z), null);
  return [
    mesh([...low, ...high], faces, colour.tube, { depth: 0.12, outward: inwards }, { opacity: 0.5 }),
    line(rings, "rgba(255,255,255,0.85)", 2),
    line([...low, ...high.reverse(), low[0]], "#7391ab", 3),
  ];
}
function cubeTraces(cube) {
  if (!cube) return [];
  const h = cube.edge_mm / 2, c = Math.cos(cube.yaw_rad), s = Math.sin(cube.yaw_rad);
  const corner = (x, y, z) => add(cube.centre_mm, [c*x*h - s*y*h, s*x*h + c*y*h, z*h]);
  const p = [];
  for (const x of [-1, 1]) for (const y of [-1, 1]) for (const z of [-1, 1]) p.push(corner(x, y, z));
  const quads = [[0,1,3,2],[4,6,7,5],[0,4,5,1],[2,3,7,6],[0,2,6,4],[1,5,7,3]], faces = { i: [], j: [], k: [] };
  for (const [a, b, d, e] of quads) { faces.i.push(a, a); faces.j.push(b, d); faces.k.push(d, e); }
  const edges = [[0,1],[1,3],[3,2],[2,0],[4,5],[5,7],[7,6],[6,4],[0,4],[1,5],[2,6],[3,7]];
  return [
    mesh(p, faces, colour.cube, { flat: true, outward: (n, q) => Math.sign(dot(n, add(q, cube.centre_mm, -1))) }),
    line(edges.flatMap(([a, b]) => [p[a], p[b], null]), "#7d6440", 3),
  ];
}

let trial = null, now = 0, playing = false, last = 0, busy = false, dynamic = [], sceneReady = false;

function dynamicTraces(shape) {
  const frames = framesOf(shape.backbone), wire = springWire(shape.backbone, frames);
  const tendons = [];
  for (let q = 0; q < 4; q++) {
    const a = q * Math.PI / 2;
    shape.backbone.forEach((p, i) => tendons.push(add(add(p, frames[i].first, run.robot.tendon_radius_mm * Math.cos(a)),
      frames[i].second, run.robot.tendon_radius_mm * Math.sin(a))));
    tendons.push(null);
  }
  return [
    holderPoints(shape.arm), pipe(wire, 0.85), capPoints(shape, frames), siliconePoints(shape, frames),
    tendons, pipe(shape.filament, 0.9), trail(), touchPoints(),
  ];
}
// A ball at each touch; before its time it has no size.
const BALL = 9;
function touchPoints() {
  return trial.contacts.filter((c) => c.point_mm).flatMap((c) => turned(Array.from({ length: BALL }, (_, i) => {
    const a = Math.PI * i / (BALL - 1), r = c.time_s <= now ? 4.2 : 0.001;
    return [add(c.point_mm, [0, 0, r * Math.cos(a)]), r * Math.sin(a) + 1e-4];
  }), [1, 0, 0], [0, 1, 0]));
}
function touchFaces() {
  const one = pipeFaces(BALL, ROUND), all = { i: [], j: [], k: [] };
  trial.contacts.filter((c) => c.point_mm).forEach((_, n) => {
    for (const key of ["i", "j", "k"]) all[key].push(...one[key].map((v) => v + n * BALL * ROUND));
  });
  return all;
}
// The tip's way in the last seconds.
function trail() {
  const m = trial.motion, end = indexBefore(m.time, now), points = [];
  for (let i = Math.max(end - 24, 0); i <= end; i++) {
    const a = 3 * (i * m.per_frame + 2);
    points.push([m.points[a] * m.step_mm, m.points[a+1] * m.step_mm, m.points[a+2] * m.step_mm]);
  }
  return points;
}

function buildScene() {
  const box = $("scene");
  sceneReady = false;
  if (!trial.motion) {
    Plotly.purge(box);
    box.innerHTML = "<p class='note' style='padding:30px'>This log holds no shape of the robot to draw.</p>";
    return;
  }
  if (box.querySelector(".note")) box.innerHTML = "";
  const of = trial, shape = shapeAt(trial.motion, now), d = dynamicTraces(shape);
  const still = [...tubeTraces(trial.tube, run.floor_mm), ...cubeTraces(trial.cube)];
  const traces = [
    ...still,
    mesh(d[0], pipeFaces(8, ROUND), colour.holder, { depth: 0.4 }),
    mesh(d[1], pipeFaces(COILS * STEPS_PER_COIL + 1, SIDES), colour.spring, { depth: 0.6 }),
    mesh(d[2], pipeFaces(5, ROUND), "#dfe5ea"),
    mesh(d[3], pipeFaces(5, ROUND), colour.silicone),
    line(d[4], colour.tendon, 4),
    mesh(d[5], pipeFaces(2, SIDES), colour.bristle),
    line(d[6], "#eeb27c", 3),
    mesh(d[7], touchFaces(), colour.contact, { depth: 0 }),
  ];
  dynamic = d.map((_, i) => still.length + i);
  const range = run.bounds_mm, hidden = { visible: false, showspikes: false };
  const size = range.map(([a, b]) => b - a), scale = 1.9 / size[2], a = run.view_rad;
  const camera = {
    projection: { type: "orthographic" }, up: { x: 0, y: 0, z: 1 }, center: { x: 0, y: 0, z: -0.06 },
    eye: { x: 2 * Math.cos(a), y: 2 * Math.sin(a), z: 0.68 },
  };
  Plotly.react(box, traces, {
    margin: { l: 0, r: 0, t: 0, b: 0 }, paper_bgcolor: "rgba(0,0,0,0)", uirevision: "scene",
    scene: {
      xaxis: { ...hidden, range: range[0] }, yaxis: { ...hidden, range: range[1] }, zaxis: { ...hidden, range: range[2] },
      aspectmode: "manual", aspectratio: { x: size[0] * scale, y: size[1] * scale, z: size[2] * scale },
      camera, dragmode: "turntable",
    },
  }, { displaylogo: false, responsive: true, displayModeBar: false }).then(() => { if (of === trial) { sceneReady = true; updateScene(); } });
}
function updateScene() {
  if (!sceneReady || busy) return;
  busy = true;
  const parts = dynamicTraces(shapeAt(trial.motion, now)).map(columns);
  Plotly.restyle($("scene"), { x: parts.map((p) => p.x), y: parts.map((p) => p.y), z: parts.map((p) => p.z) }, dynamic)
    .finally(() => { busy = false; });
}

// ------------------------------------------------------------------- pressure
const bandColour = (alpha) => `hsl(${((alpha % 360) + 360) % 360}, 55%, 90%)`;
function buildPressure() {
  const p = trial.pressure, value = Array.from(p.value, (v) => v + p.offset_hpa), t = Array.from(p.time);
  const base = Array.from(p.base, (v) => v + p.offset_hpa), bandTime = [], upper = [], lower = [];
  // One closed strip for each stretch of watching.
  for (let i = 0; i < t.length; i++) {
    if (Number.isNaN(base[i])) { if (bandTime.length && bandTime[bandTime.length-1] !== null) { bandTime.push(null); upper.push(null); lower.push(null); } continue; }
    bandTime.push(t[i]); upper.push(base[i] + trial.threshold_hpa); lower.push(base[i] - trial.threshold_hpa);
  }
  const fillX = [], fillY = [];
  let start = 0;
  for (let i = 0; i <= bandTime.length; i++) if (i === bandTime.length || bandTime[i] === null) {
    if (i > start) {
      fillX.push(...bandTime.slice(start, i), ...bandTime.slice(start, i).reverse(), bandTime[start], null);
      fillY.push(...upper.slice(start, i), ...lower.slice(start, i).reverse(), upper[start], null);
    }
    start = i + 1;
  }
  const shapes = [], notes = [];
  for (const level of trial.levels) {
    notes.push({ x: (level.start_s + level.end_s) / 2, y: 1, yref: "paper", yanchor: "bottom", showarrow: false,
      text: `${level.descent_mm} mm down`, font: { size: 13, color: colour.muted } });
    for (const d of level.directions) shapes.push({ type: "rect", layer: "below", yref: "paper", y0: 0, y1: 1,
      x0: d.start_s, x1: d.end_s, fillcolor: bandColour(d.alpha_deg), line: { width: 0 } });
  }
  const touches = trial.contacts.filter((c) => c.pressure_hpa !== null);
  Plotly.react($("pressure"), [
    { x: fillX, y: fillY, fill: "toself", mode: "lines", line: { width: 0 }, fillcolor: "rgba(31,41,51,0.11)",
      name: `baseline ± ${trial.threshold_hpa} hPa while watching`, hoverinfo: "skip" },
    { x: t, y: value, mode: "lines", line: { color: colour.pressure, width: 1.1 }, name: "pressure",
      hovertemplate: "%{x:.2f} s: %{y:.2f} hPa<extra></extra>" },
    { x: touches.map((c) => c.time_s), y: touches.map((c) => c.pressure_hpa), mode: "markers", name: "touch",
      marker: { size: 10, color: colour.contact, line: { color: "#fff", width: 1.5 } },
      text: touches.map((c) => `${c.change_hpa.toFixed(1)} hPa against the baseline, ${c.alpha_deg === null ? "on the way down" : `α = ${c.alpha_deg}°`}`),
      hovertemplate: "touch: %{text}<extra></extra>" },
  ], {
    margin: { l: 74, r: 14, t: 66, b: 50 }, font: { family: "inherit", size: 13.5, color: colour.ink }, shapes,
    annotations: notes, paper_bgcolor: "#fff", plot_bgcolor: "#fff", hovermode: "closest", dragmode: "zoom",
    xaxis: { title: { text: "time since the trial began (s)" }, range: [0, trial.duration_s], showgrid: false, zeroline: false, ticks: "outside", tickcolor: "#c5ced6" },
    yaxis: { title: { text: "pressure (hPa)" }, gridcolor: "rgba(31,41,51,0.07)", zeroline: false, tickformat: ".0f" },
    legend: { orientation: "h", x: 0, xanchor: "left", y: 1.12, yanchor: "bottom" },
  }, { displaylogo: false, responsive: true, modeBarButtonsToRemove: ["lasso2d", "select2d", "autoScale2d"] }).then(() => moveCursor());
}
function moveCursor() {
  const box = $("pressure"), layout = box._fullLayout, cursor = $("cursor");
  if (!layout || !layout.xaxis) return;
  const x = layout.xaxis.l2p(now), inside = x >= 0 && x <= layout.xaxis._length;
  cursor.style.display = inside ? "block" : "none";
  cursor.style.left = `${layout._size.l + x - 1}px`;
  cursor.style.top = `${layout._size.t}px`;
  cursor.style.height = `${layout._size.h}px`;
}

// ----------------------------------------------------------------------- roses
const depths = [...new Set(run.trials.flatMap((t) => t.levels.map((l) => l.descent_mm)))].sort((a, b) => a - b);
const alphas = [...new Set(run.trials.flatMap((t) => t.levels.flatMap((l) => l.directions.map((d) => d.alpha_deg))))].sort((a, b) => a - b);
// SVG's y points down, so α runs clockwise: what one sees looking down the tube.
const polar = (r, deg) => [100 + r * Math.cos(deg * Math.PI / 180), 100 + r * Math.sin(deg * Math.PI / 180)];
function rose(of, until) {
  const half = 180 / Math.max(alphas.length, 1), inner = 16, step = (78 - inner) / Math.max(depths.length, 1), parts = [];
  const sector = (r0, r1, alpha, style) => {
    const gap0 = 1.2 * 180 / Math.PI / r0, gap1 = 1.2 * 180 / Math.PI / r1;
    const [a, b] = polar(r0, alpha - half + gap0), [c, d] = polar(r1, alpha - half + gap1);
    const [e, f] = polar(r1, alpha + half - gap1), [g, h] = polar(r0, alpha + half - gap0);
    parts.push(`<path d="M${a} ${b}L${c} ${d}A${r1} ${r1} 0 0 1 ${e} ${f}L${g} ${h}A${r0} ${r0} 0 0 0 ${a} ${b}Z" ${style}/>`);
  };
  depths.forEach((depth, ring) => {
    const level = of.levels.find((l) => l.descent_mm === depth);
    for (const alpha of alphas) {
      const d = level && level.directions.find((x) => x.alpha_deg === alpha);
      let style = 'fill="none" stroke="#d3dbe2" stroke-width="0.7" stroke-dasharray="2 2"';
      if (d && d.start_s <= until && until < d.end_s) style = `fill="${colour.bristle}"`;
      if (d && d.end_s <= until) style = `fill="${d.touched ? colour.contact : colour.clear}"`;
      if (d && d.touched && of.contacts.some((c) => c.alpha_deg === alpha && c.descent_mm === depth && c.time_s <= until)) style = `fill="${colour.contact}"`;
      sector(inner + ring * step, inner + (ring + 1) * step - 2, alpha, style);
    }
  });
  for (const alpha of alphas) { const [x, y] = polar(95, alpha); parts.push(`<text x="${x}" y="${y}">${alpha}°</text>`); }
  if (of.cube) {
    const deg = Math.atan2(-of.cube.centre_mm[1], of.cube.centre_mm[0]) * 180 / Math.PI, [x, y] = polar(82.5, deg);
    parts.push(`<rect x="-9" y="-2.4" width="18" height="4.8" rx="1" fill="${colour.cube}" transform="translate(${x} ${y}) rotate(${deg + 90})"/>`);
  }
  depths.forEach((depth, ring) => {
    const [x, y] = polar(inner + (ring + 0.5) * step - 1, alphas.length ? alphas[0] + half : 0);
    parts.push(`<text x="${x}" y="${y}" style="font-size:5.6px;paint-order:stroke;stroke:#fff;stroke-width:2px">${depth}</text>`);
  });
  return `<svg class="rose" viewBox="-6 0 212 200" role="img" aria-label="directions touched for each depth in mm">${parts.join("")}</svg>`;
}

// ------------------------------------------------------------------------ page
function say() {
  const level = trial.levels.find((l) => now >= l.start_s && now < l.end_s);
  const d = level && level.directions.find((x) => now >= x.start_s && now < x.end_s);
  const done = trial.contacts.filter((c) => c.time_s <= now), box = $("say");
  const fresh = done.length && d && done[done.length-1].time_s >= d.start_s && done[done.length-1].alpha_deg !== null;
  box.classList.toggle("touch", Boolean(fresh));
  const lastLevel = trial.levels[trial.levels.length - 1];
  if (fresh) box.textContent = `Touch at α = ${d.alpha_deg}°. The board stops and pulls back.`;
  else if (done.length && done[done.length-1].alpha_deg === null) box.textContent = "Touched on the way down: the arm goes back up.";
  else if (d) box.textContent = `Feeling towards α = ${d.alpha_deg}°.`;
  else if (lastLevel && now >= lastLevel.end_s) box.textContent = trial.contacts.length ? "Something was touched: the arm goes back up." : "Nothing was touched: the arm goes back up.";
  else if (level) box.textContent = "Making itself short.";
  else box.textContent = "The arm goes down.";
  const p = trial.pressure, i = indexBefore(p.time, now), base = p.base[i];
  $("alpha").textContent = d ? `${d.alpha_deg}°` : "–";
  if (fresh) $("change").textContent = `${done[done.length-1].change_hpa >= 0 ? "+" : "−"}${Math.abs(done[done.length-1].change_hpa).toFixed(1)} hPa`;
  else $("change").textContent = Number.isNaN(base) || base === undefined ? "–" : `${(p.value[i] - base >= 0 ? "+" : "−")}${Math.abs(p.value[i] - base).toFixed(1)} hPa`;
  $("touches").textContent = done.length;
  if (trial.motion) $("descent").textContent = `${Math.abs(shapeAt(trial.motion, 0).arm[2] - shapeAt(trial.motion, now).arm[2]).toFixed(0)} mm`;
  else $("descent").textContent = level ? `${level.descent_mm} mm` : "–";
  const key = `${trial.number}/${level ? level.descent_mm : ""}/${d ? d.alpha_deg : ""}/${done.length}/${now >= trial.duration_s}`;
  if (say.key !== key) { $("live").innerHTML = rose(trial, now); say.key = key; }
}
function show(t) {
  now = Math.min(Math.max(t, 0), trial.duration_s);
  $("time").value = String(Math.round(1000 * now / trial.duration_s));
  $("clock").textContent = `${now.toFixed(1)} s of ${trial.duration_s.toFixed(0)} s`;
  say(); moveCursor(); updateScene();
}
function choose(index, t) {
  trial = run.trials[index];
  document.querySelectorAll("#tabs button").forEach((b, i) => b.setAttribute("aria-selected", String(i === index)));
  const first = trial.contacts.length ? trial.contacts[0].time_s + 0.001 : 0;
  now = t === undefined ? first : t;
  say.key = null;
  buildScene(); buildPressure(); show(now);
}
function play(on) {
  playing = on;
  $("play").textContent = on ? "Pause" : "Play";
  if (on) { if (now >= trial.duration_s) now = 0; last = performance.now(); requestAnimationFrame(tick); }
}
function tick(time) {
  if (!playing) return;
  const step = Math.min(time - last, 100) / 1000 * Number($("speed").value);
  last = time;
  show(now + step);
  if (now >= trial.duration_s) play(false); else requestAnimationFrame(tick);
}
run.trials.forEach((t, i) => {
  const tab = document.createElement("button");
  tab.setAttribute("role", "tab"); tab.textContent = `Trial ${t.number}: ${t.label.replace(/^obstacle /, "")}`;
  tab.onclick = () => { play(false); choose(i); };
  $("tabs").append(tab);
  const figure = document.createElement("figure");
  figure.innerHTML = `${rose(t, Infinity)}<figcaption><b>Trial ${t.number}</b>${t.label}</figcaption>`;
  const go = () => { play(false); choose(i); $("watch").scrollIntoView({ behavior: "smooth" }); };
  figure.onclick = go;
  $("roses").append(figure);
  const row = document.querySelector(`tr[data-trial="${i}"]`);
  if (row) row.onclick = go;
});
$("play").onclick = () => play(!playing);
$("time").oninput = (event) => { play(false); show(event.target.value / 1000 * trial.duration_s); };
let downAt = null;
$("pressure").addEventListener("pointerdown", (event) => { downAt = [event.clientX, event.clientY]; }, true);
window.addEventListener("pointerup", (event) => {
  const box = $("pressure"), layout = box._fullLayout;
  if (!downAt || !layout || Math.hypot(event.clientX - downAt[0], event.clientY - downAt[1]) > 4) { downAt = null; return; }
  downAt = null;
  const where = box.getBoundingClientRect(), x = event.clientX - where.left - layout._size.l, y = event.clientY - where.top - layout._size.t;
  if (x >= 0 && x <= layout.xaxis._length && y >= 0 && y <= layout._size.h) { play(false); show(layout.xaxis.p2l(x)); }
}, true);
window.addEventListener("resize", () => setTimeout(moveCursor, 150));
const firstTouch = run.trials.findIndex((t) => t.contacts.length);
choose(Math.max(firstTouch, 0));
$("pressure").on("plotly_relayout", moveCursor);
})();
