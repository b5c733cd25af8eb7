// Makes the figures that carry their curves as data react: zoom, reset, values at the cursor, curves on and off.
// Without this script the static drawing of the same curves stays in its place; print always shows that one.
"use strict";
(() => {
  const NAMESPACE = "http://www.w3.org/2000/svg";
  const MARGIN = {left: 58, right: 12, top: 8, bottom: 40, between: 12};
  const ZOOM = 2, LEAST_SHARE = 1e-5, CLICK_PIXELS = 5;

  const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;

  // A curve is 16 bit numbers over its range; the lowest of them stands for "no value".
  const unpack = (packed) => Float64Array.from(new Int16Array(bytes(packed.data)), (n) =>
    n === -32768 ? NaN : packed.middle + packed.step * n);

  const element = (name, attributes = {}, parent = null, text = null) => {
    const made = document.createElementNS(NAMESPACE, name);
    for (const [key, value] of Object.entries(attributes)) made.setAttribute(key, value);
    if (text !== null) made.textContent = text;
    if (parent) parent.append(made);
    return made;
  };

  const ticks = (low, high, most, inDegrees = false) => {
    const least = (high - low) / most;
    if (!(least > 0)) return [low];
    const power = 10 ** Math.floor(Math.log10(least));
    const decimal = power * [1, 2, 5, 10].find((s) => s * power >= least * (1 - 1e-9));
    const step = inDegrees && least > 5 ? [15, 45, 90, 180].find((s) => s >= least) || 360 * Math.ceil(least / 360) : decimal;
    const found = [];
    for (let i = Math.ceil(low / step - 1e-9); i * step <= high + 1e-9 * step; i++) found.push(i * step);
    return found;
  };

  const logTicks = (low, high, most) => {
    for (const multiples of [[1, 2, 3, 4, 5, 6, 7, 8, 9], [1, 2, 5], [1]]) {
      const found = [];
      for (let d = Math.floor(Math.log10(low)); d <= Math.ceil(Math.log10(high)); d++)
        for (const m of multiples) if (m * 10 ** d >= low * (1 - 1e-9) && m * 10 ** d <= high * (1 + 1e-9)) found.push(m * 10 ** d);
      if (found.length <= most) return found.length > 1 ? found : ticks(low, high, most);
    }
    return ticks(Math.log10(low), Math.log10(high), most).map((d) => 10 ** d);
  };

  // Digits that tell values this far apart from each other.
  const written = (value, distance) => {
    if (!Number.isFinite(value)) return "none";
    const size = Math.abs(value);
    if (size >= 1e5 || (size > 0 && size < 1e-4 && distance < 1e-4)) return value.toPrecision(3).replace("-", "\u2212");
    const decimals = Math.min(8, Math.max(0, -Math.floor(Math.log10(distance) + 1e-9)));
    return (Math.abs(value) < 0.5 * 10 ** -decimals ? 0 : value).toFixed(decimals).replace("-", "\u2212");
  };

  class Chart {
    constructor(figure) {
      const data = JSON.parse(figure.querySelector("script").textContent);
      Object.assign(this, {figure, data, hidden: new Set(), cursor: null, width: 0});
      this.panels = data.panels.map((panel) => ({
        ...panel,
        curves: panel.curves.map((curve) => {
          const y = curve.y && unpack(curve.y);
          const high = curve.high && unpack(curve.high), low = curve.low && unpack(curve.low);
          const count = (y || low).length;
          const x = Array.isArray(curve.x) ? Float64Array.from({length: count}, (_, i) => curve.x[0] + curve.x[1] * i) : unpack(curve.x);
          // Frequencies are kept as logarithms, which makes every decade equally fine.
          return {of: curve.of, x: data.log ? x.map((e) => 10 ** e) : x, y, low, high};
        }),
      }));
      this.whole = data.range;
      this.range = [...data.range];
      this.build();
      new ResizeObserver(() => this.resize()).observe(this.box);
      figure.classList.add("live");
      this.resize();
    }

    build() {
      const box = this.box = document.createElement("div");
      box.className = "chart";
      const bar = document.createElement("div");
      bar.className = "bar";
      bar.setAttribute("role", "group");
      bar.setAttribute("aria-label", "Zoom and curves");
      const button = (label, title, act) => {
        const made = document.createElement("button");
        made.type = "button";
        made.textContent = label;
        made.setAttribute("aria-label", title);
        made.title = title;
        made.addEventListener("click", () => act(made));
        bar.append(made);
        return made;
      };
      button("+", "Zoom in", () => this.zoom(1 / ZOOM));
      button("\u2212", "Zoom out", () => this.zoom(ZOOM));
      button("\u25c2", "Move left", () => this.move(-0.25));
      button("\u25b8", "Move right", () => this.move(0.25));
      button("All", "Show all", () => this.show(...this.whole));
      const detail = this.data.detail;
      if (detail) button(detail.label, detail.title, () => this.show(...detail.range));
      const used = new Set(this.panels.flatMap((panel) => panel.curves.map((curve) => curve.of)));
      for (const [of, label] of Object.entries(this.data.names)) {
        if (!used.has(of)) continue;
        const toggle = button(label, `Curve: ${label}`, () => {
          this.hidden[this.hidden.has(of) ? "delete" : "add"](of);
          toggle.setAttribute("aria-pressed", String(!this.hidden.has(of)));
          this.draw();
        });
        toggle.className = `curve ${of}`;
        toggle.setAttribute("aria-pressed", "true");
      }
      this.svg = element("svg", {
        tabindex: 0, role: "application", "aria-roledescription": "chart",
        "aria-label": `${this.data.title}. Keys: plus and minus zoom, 0 shows all, arrows read values, shift with arrows moves.`,
      });
      this.reading = document.createElement("p");
      this.reading.className = "reading";
      this.reading.setAttribute("role", "status");
      box.append(bar, this.svg, this.reading);
      this.figure.querySelector(".static").before(box);
      this.listen();
      this.read();
    }

    listen() {
      const svg = this.svg, pointers = new Map();
      let pinch = null;
      const x = (event) => event.clientX - svg.getBoundingClientRect().left;
      svg.addEventListener("pointerdown", (event) => {
        if (event.button > 0) return;
        pointers.set(event.pointerId, {from: x(event), to: x(event)});
        try { svg.setPointerCapture(event.pointerId); } catch { /* a pointer that is gone already */ }
        pinch = pointers.size === 2 ? {range: [...this.range], at: [...pointers.values()].map((p) => this.value(p.to))} : null;
      });
      svg.addEventListener("pointermove", (event) => {
        const own = pointers.get(event.pointerId);
        if (own) own.to = x(event);
        if (pinch) return this.pinch(pinch, [...pointers.values()].map((p) => p.to));
        this.cursor = this.value(x(event));
        this.drawCursor(own && Math.abs(own.to - own.from) > CLICK_PIXELS ? [own.from, own.to] : null);
        this.read();
      });
      const up = (event) => {
        const own = pointers.get(event.pointerId);
        pointers.delete(event.pointerId);
        if (!own || pinch) { if (!pointers.size) pinch = null; return; }
        if (event.type === "pointerup" && Math.abs(own.to - own.from) > CLICK_PIXELS)
          return this.show(...[this.value(own.from), this.value(own.to)].sort((a, b) => a - b));
        this.cursor = this.value(own.to);
        this.drawCursor();
        this.read();
      };
      svg.addEventListener("pointerup", up);
      svg.addEventListener("pointercancel", up);
      svg.addEventListener("dblclick", () => this.show(...this.whole));
      svg.addEventListener("keydown", (event) => {
        if (event.ctrlKey || event.altKey || event.metaKey) return;
        const act = {
          "+": () => this.zoom(1 / ZOOM), "=": () => this.zoom(1 / ZOOM), "-": () => this.zoom(ZOOM), "0": () => this.show(...this.whole),
          ArrowLeft: () => (event.shiftKey ? this.move(-0.25) : this.step(-1)),
          ArrowRight: () => (event.shiftKey ? this.move(0.25) : this.step(1)),
          Escape: () => { this.cursor = null; this.drawCursor(); this.read(); },
        }[event.key];
        if (!act) return;
        event.preventDefault();
        act();
      });
    }

    // Positions along the axis, which is linear in the value or in its logarithm.
    along(value) { return this.data.log ? Math.log10(value) : value; }
    back(place) { return this.data.log ? 10 ** place : place; }
    pixel(value) {
      const [a, b] = this.range.map((v) => this.along(v));
      return MARGIN.left + (this.along(value) - a) / (b - a) * this.inner;
    }
    value(pixel) {
      const [a, b] = this.range.map((v) => this.along(v));
      const share = Math.min(1, Math.max(0, (pixel - MARGIN.left) / this.inner));
      return this.back(a + share * (b - a));
    }

    show(low, high) {
      const [least, most] = this.whole.map((v) => this.along(v));
      const size = Math.min(most - least, Math.max(LEAST_SHARE * (most - least), this.along(high) - this.along(low)));
      const start = Math.min(most - size, Math.max(least, this.along(low)));
      this.range = [this.back(start), this.back(start + size)];
      this.draw();
    }
    zoom(factor) {
      const [a, b] = this.range.map((v) => this.along(v));
      const inside = this.cursor !== null && this.along(this.cursor) > a && this.along(this.cursor) < b;
      const middle = inside ? this.along(this.cursor) : (a + b) / 2;
      this.show(this.back(middle - (middle - a) * factor), this.back(middle + (b - middle) * factor));
    }
    move(share) {
      const [a, b] = this.range.map((v) => this.along(v));
      this.show(this.back(a + share * (b - a)), this.back(b + share * (b - a)));
    }
    pinch(start, pixels) {
      const [a, b] = start.at.map((v) => this.along(v));
      const slope = (b - a) / (pixels[1] - pixels[0]);
      if (!(slope > 0)) return;
      const low = a - (pixels[0] - MARGIN.left) * slope;
      this.show(this.back(low), this.back(low + slope * this.inner));
    }
    step(direction) {
      const [low, high] = this.range;
      const curve = this.panels[0].curves.find((c) => c.y && !this.hidden.has(c.of)) || this.panels[0].curves[0];
      const visible = curve.x.filter((v) => v >= low && v <= high);
      if (!visible.length) return;
      // A hundredth of the picture, but at least one sample.
      const stride = Math.max(1, Math.round(visible.length / 100));
      const now = this.cursor === null ? (direction > 0 ? -stride : visible.length - 1 + stride) : nearest(visible, this.cursor);
      this.cursor = visible[Math.min(visible.length - 1, Math.max(0, now + direction * stride))];
      this.drawCursor();
      this.read();
    }

    resize() {
      const width = Math.floor(this.box.clientWidth);
      if (width < 1 || width === this.width) return;
      this.width = width;
      this.inner = width - MARGIN.left - MARGIN.right;
      const height = Math.round(Math.min(430, Math.max(370, 0.55 * width)));
      const shares = this.panels.reduce((sum, panel) => sum + panel.share, 0);
      const room = height - MARGIN.top - MARGIN.bottom - MARGIN.between * (this.panels.length - 1);
      let top = MARGIN.top;
      for (const panel of this.panels) {
        panel.top = top;
        panel.height = room * panel.share / shares;
        top += panel.height + MARGIN.between;
      }
      this.height = height;
      this.svg.setAttribute("viewBox", `0 0 ${width} ${height}`);
      this.svg.setAttribute("height", height);
      this.draw();
    }

    draw() {
      if (!this.width) return;
      this.svg.replaceChildren();
      const key = this.figure.id, last = this.panels.at(-1);
      const places = (this.data.log ? logTicks : ticks)(...this.range, Math.max(3, this.width / 90));
      const distance = places.length > 1 ? Math.abs(places[1] - places[0]) : this.range[1] - this.range[0];
      this.panels.forEach((panel, index) => {
        const clip = element("clipPath", {id: `${key}-clip-${index}`}, this.svg);
        element("rect", {x: MARGIN.left, y: panel.top, width: this.inner, height: panel.height}, clip);
        this.scale(panel);
        const levels = ticks(...panel.limits, Math.max(2, panel.height / 32), panel.degrees);
        const spacing = levels.length > 1 ? levels[1] - levels[0] : panel.limits[1] - panel.limits[0];
        for (const level of levels) {
          const y = panel.y(level);
          element("line", {class: "grid", x1: MARGIN.left, x2: MARGIN.left + this.inner, y1: y, y2: y}, this.svg);
          element("text", {x: MARGIN.left - 6, y: y + 4, "text-anchor": "end"}, this.svg, written(level, spacing));
        }
        for (const place of places) {
          const x = this.pixel(place);
          element("line", {class: "grid", x1: x, x2: x, y1: panel.top, y2: panel.top + panel.height}, this.svg);
          if (panel === last)
            element("text", {x, y: panel.top + panel.height + 16, "text-anchor": "middle"}, this.svg, written(place, this.data.log ? place : distance));
        }
        element("text", {class: "name", transform: `translate(12 ${panel.top + panel.height / 2}) rotate(-90)`, "text-anchor": "middle"}, this.svg, panel.label);
        const inside = element("g", {"clip-path": `url(#${key}-clip-${index})`}, this.svg);
        if (panel.band) element("rect", {class: "floor", x: MARGIN.left, width: this.inner, y: panel.y(panel.band), height: Math.max(0, panel.y(-panel.band) - panel.y(panel.band))}, inside);
        for (const curve of panel.curves) {
          if (this.hidden.has(curve.of)) continue;
          if (curve.low) element("path", {class: `area ${curve.of}`, d: this.area(panel, curve)}, inside);
          else element("path", {class: `line ${curve.of}`, d: this.path(panel, curve)}, inside);
        }
      });
      element("text", {class: "name", x: MARGIN.left + this.inner / 2, y: this.height - 6, "text-anchor": "middle"}, this.svg, this.data.label);
      this.over = element("g", {"aria-hidden": "true"}, this.svg);
      this.drawCursor();
      this.read();
    }

    visible(curve) {
      const [low, high] = this.range;
      return [Math.max(0, bisect(curve.x, low) - 1), Math.min(curve.x.length, bisect(curve.x, high) + 1)];
    }

    scale(panel) {
      let low = Infinity, high = -Infinity;
      const [least, most] = panel.cap || [-Infinity, Infinity];
      for (const curve of panel.curves) {
        if (this.hidden.has(curve.of) || !curve.y) continue;
        const [start, stop] = this.visible(curve);
        for (let i = start; i < stop; i++) {
          const y = curve.y[i];
          if (y < low) low = y;
          if (y > high) high = y;
        }
      }
      // A simulation that left the record leaves the picture rather than press the others flat.
      low = Math.max(low, least);
      high = Math.min(high, most);
      if (!(low <= high)) [low, high] = panel.cap || [-1, 1];
      const margin = 0.06 * (high - low) || 0.5 * Math.abs(high) || 1;
      panel.limits = [low - margin, high + margin];
      panel.y = (value) => panel.top + panel.height * (1 - (value - panel.limits[0]) / (panel.limits[1] - panel.limits[0]));
    }

    // Where there are more samples than pixels, each pixel keeps its lowest and highest.
    path(panel, curve) {
      const [start, stop] = this.visible(curve), parts = [];
      const size = Math.max(1, Math.floor((stop - start) / (2 * this.inner)));
      let drawing = false;
      const put = (i) => {
        if (Number.isNaN(curve.y[i])) { drawing = false; return; }
        const y = Math.min(1e5, Math.max(-1e5, panel.y(curve.y[i])));
        parts.push(`${drawing ? "L" : "M"}${this.pixel(curve.x[i]).toFixed(1)} ${y.toFixed(1)}`);
        drawing = true;
      };
      for (let from = start; from < stop; from += size) {
        let low = from, high = from;
        for (let i = from; i < Math.min(stop, from + size); i++) {
          if (curve.y[i] < curve.y[low]) low = i;
          if (curve.y[i] > curve.y[high]) high = i;
        }
        put(Math.min(low, high));
        if (low !== high) put(Math.max(low, high));
      }
      return parts.join("");
    }

    area(panel, curve) {
      const [start, stop] = this.visible(curve), there = [], back = [];
      for (let i = start; i < stop; i++) {
        const x = this.pixel(curve.x[i]).toFixed(1);
        there.push(`${x} ${Math.max(-1e5, panel.y(curve.high[i])).toFixed(1)}`);
        back.unshift(`${x} ${Math.min(1e5, panel.y(curve.low[i])).toFixed(1)}`);
      }
      return there.length ? `M${there.join("L")}L${back.join("L")}Z` : "";
    }

    drawCursor(selection = null) {
      this.over.replaceChildren();
      const last = this.panels.at(-1), bottom = last.top + last.height;
      if (selection) {
        const [from, to] = selection.map((p) => Math.min(MARGIN.left + this.inner, Math.max(MARGIN.left, p))).sort((a, b) => a - b);
        element("rect", {class: "selection", x: from, y: MARGIN.top, width: to - from, height: bottom - MARGIN.top}, this.over);
      }
      if (this.cursor === null || this.cursor < this.range[0] || this.cursor > this.range[1]) return;
      const x = this.pixel(this.cursor);
      element("line", {class: "cursor", x1: x, x2: x, y1: MARGIN.top, y2: bottom}, this.over);
      for (const panel of this.panels)
        for (const curve of panel.curves) {
          if (this.hidden.has(curve.of) || !curve.y) continue;
          const i = nearest(curve.x, this.cursor), y = panel.y(curve.y[i]);
          if (y >= panel.top && y <= panel.top + panel.height) element("circle", {class: `dot ${curve.of}`, cx: this.pixel(curve.x[i]), cy: y, r: 3.5}, this.over);
        }
    }

    read() {
      if (this.cursor === null) {
        this.reading.textContent = "Drag to zoom, double click to see all; point to read values. Keys: + \u2212 0 and arrows.";
        return;
      }
      const [a, b] = this.range;
      const parts = [`${this.data.symbol} = ${written(this.cursor, this.data.log ? this.cursor / 100 : (b - a) / 1000)} ${this.data.unit}`];
      for (const panel of this.panels) {
        const values = panel.curves.filter((c) => c.y && !this.hidden.has(c.of)).map((c) => {
          const value = c.y[nearest(c.x, this.cursor)];
          return `${this.data.names[c.of]} ${written(value, (panel.limits ? panel.limits[1] - panel.limits[0] : 1) / 1000)}`;
        });
        if (values.length) parts.push(`${panel.label}: ${values.join(", ")}`);
      }
      this.reading.textContent = parts.join("; ");
    }
  }

  const bisect = (sorted, value) => {
    let low = 0, high = sorted.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (sorted[middle] < value) low = middle + 1; else high = middle;
    }
    return low;
  };
  const nearest = (sorted, value) => {
    const i = bisect(sorted, value);
    return i > 0 && (i === sorted.length || value - sorted[i - 1] <= sorted[i] - value) ? i - 1 : i;
  };

  for (const figure of document.querySelectorAll("figure.reacting")) new Chart(figure);

  const folded = new Set();
  addEventListener("beforeprint", () => {
    for (const fold of document.querySelectorAll("details:not([open])")) { folded.add(fold); fold.open = true; }
  });
  addEventListener("afterprint", () => {
    for (const fold of folded) fold.open = false;
    folded.clear();
  });
})();
