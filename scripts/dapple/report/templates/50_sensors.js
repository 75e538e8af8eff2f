"use strict";
// A plan of the sensors, coloured by what is asked; the series of the one that is chosen.
charts.sensors = (figure, data) => {
  const controls = figure.querySelector(".controls");
  const canvas = figure.querySelector(".canvas");
  const told = figure.querySelector(".told");
  canvas.classList.add("panels");
  canvas.removeAttribute("role");
  const plan = element(canvas, "div", { role: "img", "aria-label": "Plan of the sensors" });
  const series = element(canvas, "div", { role: "img", "aria-label": "Series of a sensor" });
  const simulated = light(data.simulated);
  const recorded = data.records ? light(data.records.par) : [];
  const low = data.bounds ? light(data.bounds.low) : [];
  const high = data.bounds ? light(data.bounds.high) : [];
  const n = data.sensors.length, t = data.times.length;
  const state = { sensor: 0, by: 0, name: data.first };

  const measures = [];
  if (data.r) measures.push({ label: "r", values: data.r, unit: "", scale: "Viridis" });
  if (data.rmse) measures.push({ label: "RMSE", values: data.rmse, unit: PAR, scale: "Magma" });
  measures.push({ label: "mean light", values: data.mean, unit: PAR, scale: "Cividis" });
  measures.push({ label: "time in sunflecks", values: data.flecks, unit: "%", scale: "Cividis" });

  function own(array, length, index) {
    return array.slice(index * length, (index + 1) * length);
  }

  function drawPlan() {
    const by = measures[state.by], values = by.values[state.name];
    const known = values.filter((value) => value !== null);
    const traces = [
      {
        type: "scatter", mode: "markers", x: data.x_m, y: data.y_m, text: data.sensors.map(plain),
        customdata: values.map((value) => (value === null ? "unknown" : `${value} ${by.unit}`)),
        hovertemplate: `sensor %{text}: ${by.label} %{customdata}<extra></extra>`,
        marker: {
          size: 15, color: values.map((value) => (value === null ? 0 : value)),
          opacity: values.map((value) => (value === null ? 0.15 : 1)),
          cmin: Math.min(...known), cmax: Math.max(...known),
          colorscale: by.scale, line: { color: "#555", width: 1 },
          colorbar: { title: { text: `${by.label} ${by.unit}`, side: "right" }, thickness: 12 },
        },
      },
      {
        type: "scatter", mode: "markers", x: [data.x_m[state.sensor]], y: [data.y_m[state.sensor]],
        hoverinfo: "skip",
        marker: { size: 24, symbol: "circle-open", color: "#d55e00", line: { width: 3 } },
      },
    ];
    return draw(plan, traces, {
      height: 380, showlegend: false, dragmode: false,
      xaxis: { title: { text: "east [m]" } },
      yaxis: { title: { text: "north [m]" }, scaleanchor: "x" },
    });
  }

  function band() {
    if (!data.bounds) return [];
    const times = data.records.times, at = state.name * n + state.sensor;
    const flat = {
      type: "scatter", mode: "lines", hoverinfo: "skip", line: { width: 0 }, x: times,
    };
    return [
      { ...flat, y: own(low, times.length, at), showlegend: false },
      {
        ...flat, y: own(high, times.length, at), fill: "tonexty",
        fillcolor: "rgba(120,120,120,0.16)", name: "90 % of records",
      },
    ];
  }

  function drawSeries() {
    const traces = data.names.map((name, k) => ({
      type: "scatter", mode: "lines", x: data.times, name: plain(name),
      y: own(simulated, t, k * n + state.sensor),
      line: { color: data.colours[k], width: k === state.name ? 2.5 : 1.2 },
      opacity: k === state.name ? 1 : 0.75,
    }));
    if (data.records) {
      traces.push({
        type: "scatter", mode: "lines+markers", x: data.records.times, name: "measured",
        y: own(recorded, data.records.times.length, state.sensor),
        line: { color: "#1a1a1a", width: 1 }, marker: { size: 4, color: "#1a1a1a" },
      });
    }
    draw(series, [...band(), ...traces], {
      height: 380, margin: { l: 60, r: 15, t: 60, b: 60 },
      xaxis: {
        title: { text: `sensor ${plain(data.sensors[state.sensor])}, time (${data.timezone})` },
      },
      yaxis: { title: { text: `PAR [${PAR}]` }, rangemode: "tozero" },
    });
    const k = state.name, said = [`${data.names[k]}`];
    if (data.r && data.r[k][state.sensor] !== null) said.push(`r = ${data.r[k][state.sensor]}`);
    if (data.rmse && data.rmse[k][state.sensor] !== null) {
      said.push(`RMSE ${data.rmse[k][state.sensor]} ${PAR}`);
    }
    for (const [before, values, after] of [
      ["mean", data.mean, PAR], ["light integral", data.integral, "mol m⁻²"],
      ["time in sunflecks", data.flecks, "%"],
    ]) {
      const value = values[k][state.sensor];
      if (value !== null) said.push(`${before} ${value} ${after}`);
    }
    told.textContent = `Sensor ${data.sensors[state.sensor]}, ${said.join(", ")}.`;
  }

  function choose(sensor) {
    state.sensor = sensor;
    list.value = sensor;
    drawPlan();
    drawSeries();
  }

  // The sensor that tells most at first: of those with records, the one whose light changes most.
  const first = data.sensors.map((_, k) => {
    if (data.r && data.r[state.name][k] === null) return -1;
    const line = own(simulated, t, state.name * n + k).filter((value) => value !== null);
    const steps = line.slice(1).map((value, i) => Math.abs(value - line[i]));
    return steps.reduce((sum, value) => sum + value, 0);
  });
  state.sensor = first.indexOf(Math.max(...first));
  const list = chooser(controls, "sensor", data.sensors, state.sensor, choose);
  chooser(controls, "reconstruction", data.names, state.name, (k) => {
    state.name = k;
    choose(state.sensor);
  });
  chooser(controls, "colour by", measures.map((one) => one.label), state.by, (k) => {
    state.by = k;
    drawPlan();
  });
  drawPlan().then(() =>
    plan.on("plotly_click", (event) => {
      if (event.points[0].curveNumber === 0) choose(event.points[0].pointIndex);
    })
  );
  drawSeries();
};
