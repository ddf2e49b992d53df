(() => {
  "use strict";
  const read = (id) => JSON.parse(document.getElementById(id).textContent);
  const root = document.documentElement;
  const figures = read("figures");
  const darkOf = read("dark");
  const places = Array.from(document.querySelectorAll(".plot"));
  const atNight = window.matchMedia("(prefers-color-scheme: dark)");
  const byTouch = window.matchMedia("(pointer: coarse)");
  let printing = false;
  root.dataset.plots = "0";
  root.dataset.errors = "0";
  const failed = () => { root.dataset.errors = String(Number(root.dataset.errors) + 1); };
  window.addEventListener("error", failed);
  window.addEventListener("unhandledrejection", failed);

  // Plotly writes into what it is given: every drawing gets a copy, with the colours of the page.
  const copy = (node, dark) => {
    if (typeof node === "string") return (dark && darkOf[node]) || node;
    if (Array.isArray(node)) return node.map((one) => copy(one, dark));
    if (node && typeof node === "object")
      return Object.fromEntries(Object.entries(node).map(([key, value]) => [key, copy(value, dark)]));
    return node;
  };

  const fit = (layout, width) => {
    layout.width = width;
    if (width < 560) {
      layout.font.size = 11.5;
      layout.margin = { ...layout.margin, l: 52, r: 10 };
      // A legend's lines stack on a narrow screen: give them room above the plot, not inside it.
      layout.legend = { ...layout.legend, font: { size: 11 } };
      layout.hovermode = layout.hovermode === "x unified" ? "x" : layout.hovermode;
    }
    // A finger that scrolls the page must not zoom the plot it happens to start on.
    if (byTouch.matches) layout.dragmode = false;
    return layout;
  };

  const draw = (place) => {
    const figure = figures[Number(place.dataset.figure)];
    const dark = atNight.matches && !printing;
    const width = printing ? 680 : place.clientWidth;
    place.dataset.width = String(width);
    return Plotly.react(place, copy(figure.data, dark), fit(copy(figure.layout, dark), width), {
      displaylogo: false,
      displayModeBar: byTouch.matches ? false : "hover",
      modeBarButtons: [["toImage"], ["zoom2d", "pan2d", "resetScale2d"]],
      // A report is the reader's own: nothing in it offers to send it anywhere.
      showSendToCloud: false,
      plotlyServerURL: "",
      toImageButtonOptions: { format: "svg", filename: place.getAttribute("aria-label") },
    });
  };
  const drawAll = () => Promise.all(places.map(draw));

  drawAll().then(() => { root.dataset.plots = String(places.length); }, failed);
  atNight.addEventListener("change", drawAll);
  let later = 0;
  window.addEventListener("resize", () => {
    if (printing) return;
    clearTimeout(later);
    later = setTimeout(() => places.filter((p) => p.clientWidth !== Number(p.dataset.width)).forEach(draw), 120);
  });
  const folds = Array.from(document.querySelectorAll("details"));
  let opened = [];
  window.addEventListener("beforeprint", () => {
    printing = true;
    opened = folds.filter((one) => !one.open);
    opened.forEach((one) => { one.open = true; });
    drawAll();
  });
  window.addEventListener("afterprint", () => {
    printing = false;
    opened.forEach((one) => { one.open = false; });
    drawAll();
  });
})();
