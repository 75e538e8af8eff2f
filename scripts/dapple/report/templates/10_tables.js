"use strict";
// A click on a column's name sorts its table by that column; a second click turns the order round.
(function () {
  function sort(table, place, turned) {
    const body = table.tBodies[0];
    const key = (row) => row.cells[place].dataset.key;
    const numbers = [...body.rows].every((row) => row.cells[place].classList.contains("number"));
    const order = (one, other) =>
      numbers
        ? number(key(one)) - number(key(other))
        : key(one).localeCompare(key(other), "en", { numeric: true });
    const rows = [...body.rows].sort(order);
    body.append(...(turned ? rows.reverse() : rows));
  }
  function number(text) {
    return text === "-inf" ? -1e300 : text === "inf" ? 1e300 : Number(text);
  }
  for (const table of document.querySelectorAll("table.sortable")) {
    const heads = [...table.tHead.rows[0].cells];
    heads.forEach((head, place) =>
      head.querySelector("button").addEventListener("click", () => {
        const turned = head.getAttribute("aria-sort") === "ascending";
        heads.forEach((one) => one.setAttribute("aria-sort", "none"));
        head.setAttribute("aria-sort", turned ? "descending" : "ascending");
        sort(table, place, turned);
      })
    );
  }
})();
