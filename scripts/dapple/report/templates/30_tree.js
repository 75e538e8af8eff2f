"use strict";
// The tree to turn, with sensors, and the light on the ground at the time of the slider.
charts.tree = (figure, data) => {
  const canvas = figure.querySelector(".canvas");
  const controls = figure.querySelector(".controls");
  const told = figure.querySelector(".told");
  const state = { shown: data.first, leaves: true, wood: true, sensors: true, ground: null };
  const eye = { x: 0.95, y: -1.3, z: 0.47 };

  function triangles(corners, colour, name) {
    const [x, y, z] = places(corners);
    const place = (k) => Uint32Array.from({ length: x.length / 3 }, (_, t) => 3 * t + k);
    return {
      type: "mesh3d", x, y, z, i: place(0), j: place(1), k: place(2), color: colour, name,
      flatshading: true, hoverinfo: "skip",
      lighting: { ambient: 0.65, diffuse: 0.6, specular: 0.05, facenormalsepsilon: 0 },
      lightposition: { x: -2000, y: -3000, z: 6000 },
    };
  }

  // Six sides of every voxel, coloured by its plant area density.
  const SIDES = [[0, 1, 3], [0, 3, 2], [4, 7, 5], [4, 6, 7], [0, 5, 1], [0, 4, 5],
    [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3]];
  function cubes(one) {
    const [x, y, z] = places(one.centres);
    const half = 0.46 * one.size_m;
    const at = { x: [], y: [], z: [] }, corner = { i: [], j: [], k: [] }, intensity = [];
    x.forEach((_, n) => {
      for (let c = 0; c < 8; c++) {
        at.x.push(x[n] + (c & 1 ? half : -half));
        at.y.push(y[n] + (c & 2 ? half : -half));
        at.z.push(z[n] + (c & 4 ? half : -half));
        intensity.push(one.density[n]);
      }
      for (const [i, j, k] of SIDES) {
        corner.i.push(8 * n + i); corner.j.push(8 * n + j); corner.k.push(8 * n + k);
      }
    });
    return {
      type: "mesh3d", ...at, ...corner, intensity, flatshading: true, hoverinfo: "skip",
      colorscale: [[0, "#d9f0a3"], [0.5, "#41ab5d"], [1, "#004529"]], opacity: 0.75,
      colorbar: { title: { text: "m² m⁻³", side: "right" }, thickness: 10, len: 0.6 },
    };
  }

  function traces() {
    const one = data.shown[state.shown];
    const found = [];
    if (state.leaves) {
      found.push(one.leaves ? triangles(one.leaves.corners, data.colours.leaf, "leaves")
        : cubes(one));
    }
    const wood = data.wood[one.name === "truth" ? "truth" : "polygons"];
    if (state.wood && wood && wood.n) found.push(triangles(wood.corners, data.colours.wood, "wood"));
    if (state.leaves && data.neighbours && data.neighbours.n) {
      found.push({ ...triangles(data.neighbours.corners, "#9aa39a", "neighbours"), opacity: 0.5 });
    }
    if (state.sensors && data.sensors) {
      found.push({
        type: "scatter3d", mode: "markers", name: "sensors", x: data.sensors.x, y: data.sensors.y,
        z: data.sensors.z, text: data.sensors.label.map(plain),
        hovertemplate: "sensor %{text}<extra></extra>",
        marker: { size: 3, color: data.colours.sensor, line: { color: "#fff", width: 1 } },
      });
    }
    if (state.ground) found.push(...state.ground);
    return found;
  }

  function redraw() {
    const axis = (title) => ({ title: { text: title }, showbackground: false, gridcolor: "#ddd" });
    const scene = {
      aspectmode: "data", camera: { eye: { ...eye }, center: { x: 0, y: 0, z: -0.16 } },
      xaxis: axis("east [m]"), yaxis: axis("north [m]"), zaxis: axis("up [m]"),
      uirevision: "turned",
    };
    const layout = { scene, height: 560, margin: { l: 0, r: 0, t: 0, b: 0 }, showlegend: false };
    draw(canvas, traces(), layout);
    told.textContent = `Shown: ${data.shown[state.shown].label}.`;
  }

  function turn(by) {
    const camera = canvas.layout.scene.camera || { eye };
    const { x, y, z } = camera.eye, angle = (by * Math.PI) / 180;
    const turned = {
      x: x * Math.cos(angle) - y * Math.sin(angle), y: x * Math.sin(angle) + y * Math.cos(angle), z,
    };
    Plotly.relayout(canvas, { "scene.camera.eye": turned });
  }

  chooser(controls, "reconstruction", data.shown.map((one) => one.label), state.shown, (k) => {
    state.shown = k;
    redraw();
  });
  for (const kind of ["leaves", "wood", "sensors"]) {
    tick(controls, kind, (is) => { state[kind] = is; redraw(); });
  }
  for (const [text, by] of [["⟲ turn left", -15], ["turn right ⟳", 15]]) {
    element(controls, "button", { type: "button" }, text).addEventListener("click", () => turn(by));
  }
  document.addEventListener("dapple:time", (event) => {
    state.ground = event.detail.in3d(data.box_m, data.sensors);
    redraw();
  });
  redraw();
};
