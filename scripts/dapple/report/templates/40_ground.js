"use strict";
// PAR on the ground, the sun and the shade at the time of a slider.
charts.ground = (figure, data) => {
  const canvas = figure.querySelector(".canvas");
  const controls = figure.querySelector(".controls");
  const told = figure.querySelector(".told");
  const values = light(data.par);
  const [rows, columns] = [data.y_m.length, data.x_m.length];
  const COLOURS = "Cividis";
  const SIDES = ["north", "north-east", "east", "south-east", "south", "south-west", "west",
    "north-west"];
  const step = data.x_m.length > 1 ? data.x_m[1] - data.x_m[0] : 1;
  const low = [data.x_m[0] - step / 2, data.y_m[0] - step / 2];
  const high = [data.x_m[columns - 1] + step / 2, data.y_m[rows - 1] + step / 2];

  function map(k) {
    return Array.from({ length: rows }, (_, row) => {
      const start = (k * rows + row) * columns;
      return values.slice(start, start + columns);
    });
  }

  function sun(k) {
    const ray = [Math.sin, Math.cos].map((f) => f((data.azimuth_deg[k] * Math.PI) / 180));
    const half = [0, 1].map((axis) => (high[axis] - low[axis]) / 2);
    const reach = 0.95 * Math.min(...[0, 1].map((axis) =>
      half[axis] / Math.max(Math.abs(ray[axis]), 1e-9)));
    return [0, 1].map((axis) => (low[axis] + high[axis]) / 2 + reach * ray[axis]);
  }

  function words(k) {
    const side = SIDES[Math.round(data.azimuth_deg[k] / 45) % 8];
    return `${data.times[k].slice(0, 16)}, sun ${data.height_deg[k].toFixed(0)}° high in the ${side}`;
  }

  function mean(k) {
    const own = values.slice(k * rows * columns, (k + 1) * rows * columns).filter((v) => v !== null);
    return own.reduce((sum, value) => sum + value, 0) / Math.max(own.length, 1);
  }

  function show(k) {
    const [x, y] = sun(k);
    const narrow = canvas.clientWidth < 600;
    const title = { text: PAR, side: narrow ? "bottom" : "right" };
    const bar = narrow ? { orientation: "h", y: -0.2, yanchor: "top" } : {};
    const traces = [
      {
        type: "heatmap", x: data.x_m, y: data.y_m, z: map(k), zmin: 0, zmax: data.top,
        colorscale: COLOURS, hovertemplate: `%{z} ${PAR}<extra></extra>`,
        colorbar: { title, thickness: 12, ...bar },
      },
      {
        type: "scatter", mode: "markers", x: data.sensor_x_m, y: data.sensor_y_m,
        text: data.sensors.map(plain), hovertemplate: "sensor %{text}<extra></extra>",
        marker: { size: 5, color: "rgba(255,255,255,0.2)", line: { color: "#fff", width: 1 } },
      },
      {
        type: "scatter", mode: "markers", x: [x], y: [y], hoverinfo: "skip",
        marker: { size: 22, symbol: "circle", color: "#ff9d00", line: { color: "#222", width: 1.5 } },
      },
    ];
    draw(canvas, traces, {
      height: narrow ? 420 : 560, showlegend: false,
      xaxis: { title: { text: "east [m]" }, range: [low[0], high[0]], constrain: "domain" },
      yaxis: {
        title: { text: "north [m]" }, range: [low[1], high[1]], scaleanchor: "x",
        constrain: "domain",
      },
    });
    told.textContent = `${words(k)}; mean PAR of the map ${mean(k).toFixed(0)} ${PAR}.`;
    slider.setAttribute("aria-valuetext", words(k));
    shown.textContent = `${data.times[k].slice(11, 16)} (${data.timezone})`;
    const detail = { in3d: (box, under) => in3d(k, box, under) };
    document.dispatchEvent(new CustomEvent("dapple:time", { detail }));
  }

  // The part of the map below and around the tree, and the sun in its direction.
  function in3d(k, box, sensors) {
    const level = sensors && sensors.z.length ? Math.min(...sensors.z) - 0.1 : box[0][2];
    const inside = (axis) => (value) => box[0][axis] <= value && value <= box[1][axis];
    const x = data.x_m.filter(inside(0)), y = data.y_m.filter(inside(1));
    const left = data.x_m.findIndex(inside(0));
    const own = map(k).filter((_, row) => inside(1)(data.y_m[row]))
      .map((row) => row.slice(left, left + x.length));
    const middle = [0, 1].map((axis) => (box[0][axis] + box[1][axis]) / 2);
    const [up, round] = [data.height_deg[k], data.azimuth_deg[k]].map((d) => (d * Math.PI) / 180);
    const half = Math.min(box[1][0] - box[0][0], box[1][1] - box[0][1]) / 2;
    const reach = Math.min(half / Math.max(Math.cos(up), 0.01),
      (1.25 * (box[1][2] - level)) / Math.max(Math.sin(up), 0.01));
    const at = [middle[0] + reach * Math.cos(up) * Math.sin(round),
      middle[1] + reach * Math.cos(up) * Math.cos(round), level + reach * Math.sin(up)];
    return [
      {
        type: "surface", x, y, z: own.map((row) => row.map(() => level)), surfacecolor: own,
        cmin: 0, cmax: data.top, colorscale: COLOURS, showscale: false, hoverinfo: "skip",
        lighting: { ambient: 1, diffuse: 0, specular: 0 },
      },
      {
        type: "scatter3d", mode: "lines+markers", x: [at[0], middle[0]], y: [at[1], middle[1]],
        z: [at[2], level], hoverinfo: "skip", line: { color: "#b36e00", width: 3, dash: "dash" },
        marker: { size: [14, 0.1], color: "#ff9d00", line: { color: "#222", width: 1 } },
      },
    ];
  }

  const around = element(controls, "label", {}, "time");
  const middle = Math.floor(data.times.length / 2);
  const slider = element(around, "input", {
    type: "range", min: 0, max: data.times.length - 1, step: 1, value: middle,
  });
  const shown = element(around, "output", {});
  slider.addEventListener("input", () => show(Number(slider.value)));
  show(middle);
};
