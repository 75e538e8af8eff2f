"use strict";
for (const figure of document.querySelectorAll("figure.chart")) {
  const data = JSON.parse(figure.querySelector("script").textContent);
  charts[figure.dataset.drawnBy](figure, data);
}
