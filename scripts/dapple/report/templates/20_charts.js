"use strict";
// What charts share: packed arrays, controls, one look, and the functions that draw, by name.
const charts = {};

function unpack(packed) {
  const bytes = Uint8Array.from(atob(packed.base64), (letter) => letter.charCodeAt(0));
  return new Uint16Array(bytes.buffer);
}

function light(packed) {
  return Array.from(unpack(packed), (value) => (value === 65535 ? null : value));
}

function places(packed) {
  const steps = unpack(packed);
  return [0, 1, 2].map((axis) =>
    Float32Array.from({ length: steps.length / 3 }, (_, k) =>
      packed.low_m[axis] + packed.step_m * steps[3 * k + axis])
  );
}

// Plotly reads some HTML in its labels: labels of the input are text.
function plain(text) {
  return String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
}

function element(parent, name, attributes, text) {
  const made = document.createElement(name);
  for (const [key, value] of Object.entries(attributes || {})) made.setAttribute(key, value);
  if (text !== undefined) made.textContent = text;
  parent.append(made);
  return made;
}

function chooser(controls, label, options, chosen, changed) {
  const around = element(controls, "label", {}, label);
  const select = element(around, "select", {});
  options.forEach((text, k) => element(select, "option", { value: k }, text));
  select.value = chosen;
  select.addEventListener("change", () => changed(Number(select.value)));
  return select;
}

function tick(controls, label, changed) {
  const around = element(controls, "label", {});
  const box = element(around, "input", { type: "checkbox" });
  box.checked = true;
  around.append(label);
  box.addEventListener("change", () => changed(box.checked));
}

const PAR = "µmol m⁻² s⁻¹";
const LOOK = {
  font: { family: "system-ui, DejaVu Sans, sans-serif", size: 13, color: "#1a1a1a" },
  margin: { l: 60, r: 15, t: 30, b: 50 },
  paper_bgcolor: "#fff",
  plot_bgcolor: "#fff",
  hovermode: "closest",
  legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 },
};
const OPTIONS = { responsive: true, displaylogo: false, displayModeBar: false };

function draw(canvas, data, layout) {
  const axes = {};
  for (const name of Object.keys(layout).filter((key) => /^[xy]axis/.test(key))) {
    axes[name] = { gridcolor: "#e4e4e4", zeroline: false, automargin: true, ...layout[name] };
  }
  return Plotly.react(canvas, data, { ...LOOK, ...layout, ...axes }, OPTIONS);
}

charts.figure = (figure, data) => {
  const layout = { height: 380, xaxis: {}, yaxis: {}, ...data.layout };
  draw(figure.querySelector(".canvas"), data.data, layout);
};
