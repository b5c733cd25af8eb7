// Draws the curves that figures of the page carry as data with uPlot: zoom, values at the cursor, curves on and off.
"use strict";
(() => {
  const LOOKS = {measured: {width: 3, alpha: 0.6}, before: {dash: [7, 3]}, reidentified: {dash: [2, 2]}};
  const LINES = {before: "dashed", reidentified: "dotted"};
  const DEGREES = [0.1, 0.2, 0.5, 1, 2, 5, 15, 45, 90, 180, 360, 720];
  const FONT = '12px system-ui, "Segoe UI", Roboto, "DejaVu Sans", sans-serif';
  const HEIGHT = 74, PRINTED_WIDTH = 880, PER_TICK = 60, CLICK_PIXELS = 5;

  const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`);
  const written = (value, digits) => (value == null ? "\u2013" : String(+value.toPrecision(digits)).replace("-", "\u2212"));
  const labels = (_, places) => places.map((place) => written(place, 8));

  // uPlot's own ticks of a logarithmic axis are gone once less than a decade is seen.
  const logTicks = (plot, axis, low, high) => {
    const most = plot.width / PER_TICK;
    for (const multiples of [[1], [1, 2, 5], [1, 2, 3, 4, 5, 6, 7, 8, 9]]) {
      const found = [];
      for (let decade = Math.floor(Math.log10(low)); decade <= Math.log10(high); decade++)
        found.push(...multiples.map((m) => m * 10 ** decade).filter((place) => place >= low && place <= high));
      if (found.length > 3 && found.length <= most) return found;
    }
    const power = 10 ** Math.floor(Math.log10((high - low) / most));
    const step = power * [1, 2, 5, 10].find((m) => m * power * most >= high - low);
    const start = Math.ceil(low / step);
    return Array.from({length: Math.floor(high / step) - start + 1}, (_, i) => (start + i) * step);
  };

  class Chart {
    constructor(figure) {
      Object.assign(this, {data: JSON.parse(figure.querySelector("script").textContent), key: figure.id, plots: []});
      this.box = figure.querySelector(".chart");
      new ResizeObserver(() => this.resize()).observe(this.box);
    }

    // A folded record has no width: its charts are drawn once it is opened.
    resize(width = this.box.clientWidth) {
      if (width < 1) return;
      if (!this.plots.length) this.build();
      this.plots.forEach((plot, i) => plot.setSize({width, height: HEIGHT * this.data.panels[i].share + plot.axes[0].size()}));
    }

    build() {
      const {data} = this, first = data.x[0], last = data.x.at(-1);
      const show = (min, max) => this.plots.forEach((plot) => plot.setScale("x", {min, max}));
      const [along, back] = data.log ? [Math.log, Math.exp] : [Number, Number];
      const change = (from, to) => {
        const {min, max} = this.plots[0].scales.x, [a, b, least, most] = [min, max, first, last].map(along);
        const low = a + from * (b - a), high = a + to * (b - a);
        const inward = Math.max(least - low, 0) + Math.min(most - high, 0);
        show(back(low + inward), back(high + inward));
      };
      const bar = this.box.appendChild(document.createElement("div"));
      bar.className = "bar";
      const button = (textContent, title, onclick) =>
        Object.assign(bar.appendChild(document.createElement("button")), {type: "button", textContent, title, ariaLabel: title, onclick});
      button("+", "Zoom in", () => change(0.25, 0.75));
      button("\u2212", "Zoom out", () => change(-0.5, 1.5));
      button("\u25c2", "Move left", () => change(-0.25, 0.75));
      button("\u25b8", "Move right", () => change(0.25, 1.25));
      button("All", "Show all", () => show(first, last));
      if (data.detail) button(data.detail.label, data.detail.title, () => show(data.detail.low, data.detail.high));
      this.plots = data.panels.map((panel) => this.plot(panel, panel === data.panels.at(-1)));
    }

    plot(panel, isLast) {
      const {data} = this, first = data.x[0], last = data.x.at(-1), values = [data.x], bands = [];
      const series = [{label: data.label, value: (_, v) => written(v, 6)}];
      for (const curve of panel.curves) {
        const own = {label: curve.name, of: curve.of, mark: `var(--${curve.of})`, points: {show: false}, spanGaps: data.log};
        if (curve.y) {
          values.push(curve.y);
          series.push({...own, stroke: () => color(curve.of), width: 1.4, ...LOOKS[curve.of], value: (_, v) => written(v, 4)});
        } else {
          const [low, high] = [curve.low, curve.high].map((limit) => (limit.length ? limit : data.x.map(() => limit)));
          bands.push({series: [values.length + 1, values.length], fill: () => `${color(curve.of)}40`});
          values.push(low, high);
          const span = (_, v, s, i) => (i == null ? "\u2013" : `${written(low[i], 4)} to ${written(high[i], 4)}`);
          series.push({...own, auto: false, class: "area", value: span}, {...own, auto: false, class: "limit"});
        }
      }
      const inside = (_, min, max) => {
        const [least, most] = panel.cap;
        let [low, high] = [Math.max(min ?? least, least), Math.min(max ?? most, most)];
        if (low > high) [low, high] = panel.cap;
        const air = 0.06 * (high - low) || 0.5 * Math.abs(high) || 1;
        return [low - air, high + air];
      };
      const axis = {stroke: () => color("text"), font: FONT, labelFont: FONT, labelSize: 18, ticks: {show: false},
        grid: {stroke: () => color("grid"), width: 1}, values: labels};
      const plot = new uPlot({
        width: 100, height: 100, padding: [8, 12, 0, 0], series, bands,
        scales: {
          x: {time: false, distr: data.log ? 3 : 1, range: (_, min, max) => [Math.max(min, first), Math.min(max, last)]},
          y: {range: inside},
        },
        axes: [
          {...axis, ...(data.log && {splits: logTicks, filter: (_, places) => places}),
            ...(isLast ? {label: data.label, size: 24} : {values: (_, places) => places.map(() => ""), size: 6})},
          {...axis, label: panel.label, size: 62, ...(panel.degrees && {incrs: DEGREES})},
        ],
        cursor: {sync: {key: this.key, setSeries: false}, drag: {dist: CLICK_PIXELS}, points: {size: 7}, y: false},
        legend: {markers: {width: 3, dash: (_, i) => LINES[series[i].of] || "solid", stroke: (_, i) => series[i].mark}},
        hooks: {setSeries: [(_, i, {show}) => show == null || this.toggle(series[i].label, show)]},
      }, values, this.box);
      this.listen(plot);
      return plot;
    }

    // A curve is on or off in all panels.
    toggle(label, show) {
      for (const plot of this.plots)
        plot.series.forEach((own, i) => {
          if (own.label !== label || own.class === "limit") return;
          plot.root.querySelectorAll(".u-legend th")[i].ariaPressed = show;
          if (own.show !== show) plot.setSeries(i, {show});
        });
    }

    listen(plot) {
      for (const name of plot.root.querySelectorAll(".u-series:not(:first-child) th")) {
        Object.assign(name, {tabIndex: 0, role: "button", ariaPressed: true, title: "Show or hide"});
        name.onkeydown = (event) => [" ", "Enter"].includes(event.key) && (event.preventDefault(), name.click());
      }
      Object.assign(plot.over, {tabIndex: 0, role: "application", ariaLabel: `${this.data.title}. Left and right arrow read values.`});
      plot.over.onkeydown = (event) => {
        const step = {ArrowLeft: -1, ArrowRight: 1}[event.key];
        if (!step) return;
        event.preventDefault();
        const width = plot.over.clientWidth, from = plot.cursor.left < 0 ? width / 2 : plot.cursor.left;
        plot.setCursor({left: Math.min(width, Math.max(0, from + step * width / 100)), top: 1}, true, true);
      };
      // uPlot knows no fingers; without movement it takes a move for a stray one.
      for (const [touch, mouse] of [["touchstart", "mousedown"], ["touchmove", "mousemove"], ["touchend", "mouseup"]])
        plot.over.addEventListener(touch, ({changedTouches: [{clientX, clientY}]}) =>
          plot.over.dispatchEvent(new MouseEvent(mouse, {clientX, clientY, movementX: 1, bubbles: true})), {passive: true});
    }
  }

  const charts = [...document.querySelectorAll("figure.reacting")].map((figure) => new Chart(figure));
  const redraw = () => charts.forEach((chart) => chart.plots.forEach((plot) => plot.redraw(false)));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);

  const folded = new Set();
  const onPaper = (is) => document.documentElement.classList.toggle("on-paper", is);
  addEventListener("beforeprint", () => {
    for (const fold of document.querySelectorAll("details:not([open])")) { folded.add(fold); fold.open = true; }
    onPaper(true);
    charts.forEach((chart) => chart.resize(PRINTED_WIDTH));
  });
  addEventListener("afterprint", () => {
    for (const fold of folded) fold.open = false;
    folded.clear();
    onPaper(false);
    charts.forEach((chart) => chart.resize());
    redraw();
  });
})();
