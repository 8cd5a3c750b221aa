"use strict";
// Measured against models in time, and what each model leaves: zoom, pan, toggle, and read with the pointer.
(() => {
  const box = document.getElementById("chart");
  const records = JSON.parse(document.getElementById("chart-data").textContent);
  const models = ["before", "after"];
  const words = { measured: "measured", before: "declared", after: "final" };
  const shown = { measured: true, before: true, after: true };
  const find = (name) => box.querySelector(`[data-part="${name}"]`);
  const choice = find("choice"), readout = find("readout");
  let plots = [], whole = [0, 1], channel, time;

  function unpacked(packed) {
    const bytes = Uint8Array.from(atob(packed.data), (c) => c.charCodeAt(0));
    const view = new DataView(bytes.buffer);
    return Array.from({ length: bytes.length / 2 }, (_, i) => {
      const whole = view.getInt16(2 * i, true);
      return whole === -32768 ? null : packed.low + packed.step * (whole + 32767);
    });
  }

  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

  function select() {
    const [r, c] = choice.value.split(" ").map(Number);
    const record = records[r];
    channel = record.channels[c];
    time = record.time.values
      || Array.from({ length: record.time.n }, (_, i) => record.time.start + i * record.time.step);
    whole = [time[0], time[time.length - 1]];
    const measured = unpacked(channel.measured);
    const left = Object.fromEntries(Object.entries(channel.left).map(([m, p]) => [m, unpacked(p)]));
    const present = models.filter((m) => m in left);
    const sum = (m) => measured.map((y, i) => y === null || left[m][i] === null ? null : y + left[m][i]);
    const small = (m) => left[m].map((y) => y === null ? null : y * channel.factor);
    draw(present, [time, measured, ...present.map(sum)], [time, ...present.map(small)]);
  }

  function series(name) {
    const look = { measured: [1, [], true], before: [1.4, [6, 3], false], after: [1.4, [], false] }[name];
    return {
      label: words[name], key: name, show: shown[name], stroke: colour(name), width: look[0], dash: look[1],
      points: look[2] ? { show: true, size: 3, fill: colour(name), stroke: colour(name) } : { show: false },
      ...(look[2] ? { paths: () => null } : {}),
    };
  }

  function axes(label, last) {
    const look = { stroke: colour("soft"), grid: { stroke: colour("line"), width: 1 }, ticks: { stroke: colour("line") } };
    const font = "12px system-ui, sans-serif";
    return [
      { ...look, font, labelFont: font, size: last ? 34 : 20, label: last ? "time [s]" : undefined, labelSize: 16,
        values: last ? undefined : (u, ticks) => ticks.map(() => "") },
      { ...look, font, labelFont: font, label, size: 58, labelSize: 18, space: last ? 16 : 30 },
    ];
  }

  const sync = uPlot.sync("recording");
  let moving = false;
  function follow(from) {
    if (moving) { return; }
    moving = true;
    const { min, max } = from.scales.x;
    plots.filter((p) => p !== from).forEach((p) => p.setScale("x", { min, max }));
    moving = false;
    box.dataset.from = min;
    box.dataset.to = max;
  }

  // The band that the instrument's noise leaves, two standard deviations wide each way.
  function band(u) {
    const wide = 2 * channel.noise * channel.factor;
    const [top, bottom] = [u.valToPos(wide, "y", true), u.valToPos(-wide, "y", true)];
    u.ctx.save();
    u.ctx.beginPath();
    u.ctx.rect(u.bbox.left, u.bbox.top, u.bbox.width, u.bbox.height);
    u.ctx.clip();
    u.ctx.fillStyle = colour("band");
    u.ctx.fillRect(u.bbox.left, top, u.bbox.width, bottom - top);
    u.ctx.restore();
  }

  function made(data, names, label, height, target, last) {
    const options = {
      width: target.clientWidth, height, scales: { x: { time: false } }, legend: { show: false },
      series: [{ label: "time" }, ...names.map(series)], axes: axes(label, last),
      cursor: { sync: { key: sync.key, scales: ["x", null] }, drag: { x: true, y: false, setScale: true } },
      hooks: {
        setScale: [(u, key) => { if (key === "x" && plots.includes(u)) { follow(u); } }],
        setCursor: [(u) => { if (u === plots[0]) { read(u.cursor.idx); } }],
        drawClear: last ? [band] : [],
      },
    };
    return new uPlot(options, data, target);
  }

  function draw(present, values, left) {
    plots.forEach((p) => p.destroy());
    plots = [];
    // Both plots are seen with the answer beside them.
    const narrow = box.clientWidth < 480, [tall, less] = narrow ? [125, 102] : [190, 130];
    // The choice of recordings says what is read: a name that is longer than the axis is left out, at 6.3 px a letter.
    const fits = (text) => !narrow && 6.3 * text.length < tall - 25;
    const label = (what, unit) => !unit || fits(`${what} [${unit}]`) ? `${what}${unit ? ` [${unit}]` : ""}` : `[${unit}]`;
    const top = made(values, ["measured", ...present], label(channel.name, channel.unit), tall, find("values"), false);
    const low = made(left, present, channel.small ? `error [${channel.small}]` : "error", less, find("left"), true);
    plots = [top, low];
    box.dataset.from = whole[0];
    box.dataset.to = whole[1];
    read(null);
    // Where the curves would run into one another, a stretch is shown first.
    const middle = time.length >> 1;
    if (time.length > 3000) { view(time[middle - 300], time[middle + 300]); }
  }

  const digits = (x) => x === null || x === undefined ? "–" : x.toPrecision(4).replace("-", "−");
  function read(i) {
    if (i === null || i === undefined) {
      readout.textContent = "Drag to zoom, drag with Shift to move, double-click for all. Keys: + − ← → 0.";
      return;
    }
    const at = (p, k) => `${p.series[k].label} ${digits(p.data[k][i])}`;
    const list = (p) => p.series.slice(1).map((s, k) => s.show ? at(p, k + 1) : "").filter(Boolean).join(", ");
    readout.textContent = `t = ${digits(time[i])} s: ${list(plots[0])} ${channel.unit}; `
      + `error: ${list(plots[1])} ${channel.small}`;
  }

  function view(from, to) {
    const span = Math.min(to - from, whole[1] - whole[0]);
    const min = Math.max(whole[0], Math.min(from, whole[1] - span));
    plots[0].setScale("x", { min, max: min + span });
  }

  function act(what) {
    const { min, max } = plots[0].scales.x, span = max - min, middle = (min + max) / 2;
    const steps = {
      in: [middle - span / 4, middle + span / 4], out: [middle - span, middle + span],
      back: [min - span / 4, max - span / 4], on: [min + span / 4, max + span / 4], all: whole,
    };
    view(...steps[what]);
  }

  function toggle(name, button) {
    shown[name] = !shown[name];
    button.setAttribute("aria-pressed", String(shown[name]));
    plots.forEach((p) => p.series.forEach((s, k) => {
      if (s.key === name) { p.setSeries(k, { show: shown[name] }); }
    }));
  }

  // With Shift held, the pointer moves the stretch that is shown.
  function pan(event) {
    if (!event.shiftKey || event.button !== 0) { return; }
    event.preventDefault();
    event.stopPropagation();
    const { min, max } = plots[0].scales.x, start = event.clientX;
    const per = (max - min) / plots[0].over.clientWidth;
    const move = (e) => { view(min - (e.clientX - start) * per, max - (e.clientX - start) * per); };
    const end = () => { removeEventListener("mousemove", move); removeEventListener("mouseup", end); };
    addEventListener("mousemove", move);
    addEventListener("mouseup", end);
  }

  records.forEach((record, r) => record.channels.forEach((c, k) => {
    choice.add(new Option(`${record.name} (${record.role}): ${c.name}`, `${r} ${k}`));
  }));
  choice.addEventListener("change", select);
  box.querySelectorAll("[data-act]").forEach((b) => { b.addEventListener("click", () => act(b.dataset.act)); });
  box.querySelectorAll("[data-series]").forEach((b) => {
    b.addEventListener("click", () => toggle(b.dataset.series, b));
  });
  const keys = { "+": "in", "=": "in", "-": "out", "ArrowLeft": "back", "ArrowRight": "on", "0": "all" };
  find("plots").addEventListener("keydown", (event) => {
    if (event.key in keys) { event.preventDefault(); act(keys[event.key]); }
  });
  find("plots").addEventListener("mousedown", pan, true);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", select);
  let width = 0;
  new ResizeObserver(() => {
    if (find("plots").clientWidth !== width) { width = find("plots").clientWidth; if (plots.length) { resize(); } }
  }).observe(box);
  function resize() { plots.forEach((p) => p.setSize({ width: find("plots").clientWidth, height: p.height })); }

  document.documentElement.classList.add("live");
  box.hidden = false;
  select();
})();
