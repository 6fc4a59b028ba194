// The timeline: states, marks and lanes over one axis of time. What stands still is painted once.

const BAND = 20, ROW = 18, PLOT = 50, TITLE = 16, AXIS = 22, TOP = 4;
const GUTTER = 176, RIGHT = 10; // px; a narrow page has its titles above the plots instead
const NARROW = 620;

function lanesLayout(player, width) {
  const { scene } = player;
  const narrow = width < NARROW;
  const kinds = Object.keys(MARK_SHAPES).filter((kind) => scene.head.marks.some((m) => m.kind === kind));
  const left = narrow ? 8 : GUTTER;
  let y = TOP;
  const take = (height, title = 0) => { const top = y + title; y = top + height; return { top, height, title }; };
  const band = take(BAND);
  y += 4;
  const rows = kinds.map((kind) => ({ kind, ...take(ROW, narrow ? TITLE : 0) }));
  y += 4;
  const plots = scene.lanes.map((lane) => { const plot = { lane, ...take(PLOT, narrow ? TITLE : 0) }; y += 8; return plot; });
  const axis = take(AXIS);
  return { narrow, left, right: width - RIGHT, band, rows, plots, axis, height: y, width };
}

function lanesHeight(section, width) {
  const narrow = width < NARROW;
  const [rows, lanes] = [Number(section.dataset.rows), Number(section.dataset.lanes)];
  const title = narrow ? TITLE : 0;
  return TOP + BAND + 8 + rows * (ROW + title) + lanes * (PLOT + title + 8) + AXIS;
}

const timeToX = (layout, end, t) => layout.left + (t / end) * (layout.right - layout.left);
const xToTime = (layout, end, x) =>
  Math.min(Math.max(((x - layout.left) / (layout.right - layout.left)) * end, 0), end);

function drawLanes(player) {
  const { context, width, height, ratio } = sharp(player.lanes);
  const { scene, inks, t } = player;
  const key = [width, height, ratio, inks.paper, inks.ink, inks.belief].join();
  if (!player.course || player.course.key !== key) {
    const still = document.createElement("canvas");
    still.width = player.lanes.width;
    still.height = player.lanes.height;
    const ink = still.getContext("2d");
    ink.setTransform(ratio, 0, 0, ratio, 0, 0);
    const layout = lanesLayout(player, width);
    drawStill(ink, player, layout, ratio);
    player.course = { key, still, layout };
  }
  const { still, layout } = player.course;
  context.setTransform(1, 0, 0, 1, 0, 0);
  context.clearRect(0, 0, still.width, still.height);
  context.drawImage(still, 0, 0);
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  const end = scene.head.end_s || 1;
  if (player.hovered !== null) cursor(context, layout, timeToX(layout, end, player.hovered), inks.soft, 1, [3, 3]);
  cursor(context, layout, timeToX(layout, end, t), inks.ink, 2, []);
  drawValues(context, player, layout, player.hovered === null ? t : player.hovered, end);
}

function cursor(context, layout, x, colour, line, dash) {
  context.strokeStyle = colour;
  context.lineWidth = line;
  context.setLineDash(dash);
  context.beginPath();
  context.moveTo(x, 0);
  context.lineTo(x, layout.axis.top);
  context.stroke();
  context.setLineDash([]);
  if (line < 2) return;
  context.fillStyle = colour;
  context.beginPath();
  context.moveTo(x - 6, 0); context.lineTo(x + 6, 0); context.lineTo(x, 8);
  context.fill();
}

// The values at the cursor stand beside their titles, and as dots on their curves.
function drawValues(context, player, layout, t, end) {
  const { scene, inks } = player;
  context.textBaseline = "middle";
  const x = timeToX(layout, end, t);
  for (const plot of layout.plots) {
    const value = laneAt(plot.lane, t);
    const beyond = isBeyond(plot.lane, value);
    context.font = `700 13px ${inks.font}`;
    context.textAlign = layout.narrow ? "right" : "left";
    context.fillStyle = beyond ? inks.error : inks.ink;
    const text = `${laneText(plot.lane, value)}${beyond ? " !" : ""}`;
    if (layout.narrow) context.fillText(text, layout.right, plot.top - TITLE / 2);
    else context.fillText(text, 0, plot.top + PLOT - 9);
    if (value === null) continue;
    context.beginPath();
    context.arc(x, plotY(plot, value), 3.5, 0, 2 * Math.PI);
    context.fillStyle = beyond ? inks.error : inks.hindsight;
    context.strokeStyle = inks.paper;
    context.lineWidth = 1.5;
    context.fill();
    context.stroke();
  }
  context.textAlign = "left";
  const state = stateAt(scene, t);
  if (!state || layout.narrow) return;
  context.font = `700 13px ${inks.font}`;
  context.fillStyle = inks.ink;
  context.fillText(state[1], 0, layout.band.top + BAND / 2);
}

function isBeyond(lane, value) {
  if (value === null || lane.limit === null) return false;
  return lane.key === "match" ? value < lane.limit : value > lane.limit;
}

function drawStill(context, player, layout, ratio) {
  const { scene, inks } = player;
  const end = scene.head.end_s || 1;
  context.textBaseline = "middle";
  drawAxis(context, layout, end, inks);
  drawBand(context, scene, layout, end, inks, ratio);
  for (const row of layout.rows) drawRow(context, scene, layout, row, end, inks);
  for (const plot of layout.plots) drawPlot(context, scene, layout, plot, end, inks);
}

function drawAxis(context, layout, end, inks) {
  const about = end / Math.max((layout.right - layout.left) / 90, 2);
  const power = 10 ** Math.floor(Math.log10(about));
  const step = [1, 2, 5, 10].map((n) => n * power).find((n) => n >= about);
  context.font = `12px ${inks.font}`;
  context.textAlign = "center";
  context.strokeStyle = inks.rule;
  context.lineWidth = 1;
  for (let t = 0; t <= end + 1e-9; t += step) {
    const x = timeToX(layout, end, t);
    context.beginPath();
    context.moveTo(x, layout.band.top + BAND);
    context.lineTo(x, layout.axis.top + 3);
    context.stroke();
    context.fillStyle = inks.soft;
    context.textAlign = t === 0 ? "left" : x > layout.right - 18 ? "right" : "center";
    context.fillText(`${Number(t.toPrecision(6))}${t === 0 ? " s" : ""}`, x, layout.axis.top + 12);
  }
  context.textAlign = "left";
}

function drawBand(context, scene, layout, end, inks, ratio) {
  context.font = `600 12px ${inks.font}`;
  for (const [state, name, from, to] of scene.head.states) {
    const [x0, x1] = [timeToX(layout, end, from), timeToX(layout, end, to)];
    const { top } = layout.band;
    context.fillStyle = inks[`state-${state}`];
    context.fillRect(x0, top, Math.max(x1 - x0, 1), BAND);
    if (HATCHES[state]) {
      context.globalAlpha = 0.45;
      context.fillStyle = hatch(context, HATCHES[state], inks.paper, ratio);
      context.fillRect(x0, top, x1 - x0, BAND);
      context.globalAlpha = 1;
    }
    context.strokeStyle = inks.paper;
    context.lineWidth = 1.5;
    context.strokeRect(x0, top, x1 - x0, BAND);
    const wide = context.measureText(name).width;
    if (wide + 16 > x1 - x0) continue;
    context.fillStyle = inks.paper;
    context.globalAlpha = 0.9;
    context.beginPath();
    context.roundRect(x0 + 4, top + 2.5, wide + 8, BAND - 5, 3);
    context.fill();
    context.globalAlpha = 1;
    context.fillStyle = inks.ink;
    context.fillText(name, x0 + 8, top + BAND / 2 + 0.5);
  }
}

function drawRow(context, scene, layout, row, end, inks) {
  const marks = scene.head.marks.filter((mark) => mark.kind === row.kind);
  const middle = row.top + ROW / 2;
  const y = layout.narrow ? row.top - TITLE / 2 : middle;
  context.font = `12px ${inks.font}`;
  drawMark(context, row.kind, 7 + (layout.narrow ? layout.left : 0), y, 5, inks, "info");
  context.fillStyle = inks.soft;
  context.fillText(`${MARK_NAMES[row.kind]} (${marks.length})`, 18 + (layout.narrow ? layout.left : 0), y);
  context.strokeStyle = inks.rule;
  context.lineWidth = 1;
  context.beginPath();
  context.moveTo(layout.left, middle);
  context.lineTo(layout.right, middle);
  context.stroke();
  for (const mark of marks) {
    if (mark.end === null) continue;
    context.strokeStyle = inks[mark.severity];
    context.lineWidth = 4;
    context.globalAlpha = 0.45;
    context.beginPath();
    context.moveTo(timeToX(layout, end, mark.t), middle);
    context.lineTo(timeToX(layout, end, mark.end), middle);
    context.stroke();
    context.globalAlpha = 1;
  }
  for (const mark of marks) {
    drawMark(context, mark.kind, timeToX(layout, end, mark.t), middle, 6, inks, mark.severity);
  }
}

function drawPlot(context, scene, layout, plot, end, inks) {
  const { lane } = plot;
  const { top } = plot;
  plot.range = rangeOf(lane);
  context.font = `12px ${inks.font}`;
  context.fillStyle = inks.soft;
  const title = lane.unit ? `${lane.title} [${lane.unit}]` : lane.title;
  if (layout.narrow) context.fillText(title, layout.left, top - TITLE / 2);
  else wrapText(context, title, 0, top + 7, GUTTER - 14);
  context.fillStyle = inks.soft;
  context.globalAlpha = 0.06;
  context.fillRect(layout.left, top, layout.right - layout.left, PLOT);
  context.globalAlpha = 1;
  const curve = curveOf(layout, plot, end);
  if (lane.limit !== null) fillBeyond(context, layout, plot, curve, inks);
  context.save();
  context.beginPath();
  context.rect(layout.left, top - 1, layout.right - layout.left, PLOT + 2);
  context.clip();
  context.strokeStyle = inks.hindsight;
  context.lineWidth = 1.5;
  context.lineJoin = "round";
  context.stroke(curve.line);
  context.restore();
  if (lane.limit === null) return;
  const y = plotY(plot, lane.limit);
  context.strokeStyle = inks.ink;
  context.setLineDash([5, 4]);
  context.lineWidth = 1;
  context.beginPath();
  context.moveTo(layout.left, y);
  context.lineTo(layout.right, y);
  context.stroke();
  context.setLineDash([]);
  context.font = `11px ${inks.font}`;
  const text = `limit ${laneText(lane, lane.limit)}`;
  const wide = context.measureText(text).width;
  haloed(context, text, layout.right - wide - 2, y < top + 14 ? y + 9 : y - 8, inks, inks.soft);
}

// Down from the title's place, in as many lines as the gutter asks for.
function wrapText(context, text, x, y, most) {
  let line = "";
  for (const word of text.split(" ")) {
    const longer = line ? `${line} ${word}` : word;
    if (context.measureText(longer).width > most && line) {
      context.fillText(line, x, y);
      y += 14;
      line = word;
    } else line = longer;
  }
  context.fillText(line, x, y);
}

function rangeOf(lane) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of lane.values) {
    if (!Number.isFinite(value)) continue;
    low = Math.min(low, value);
    high = Math.max(high, value);
  }
  if (lane.key === "nees") {
    const top = Math.max(high, lane.limit || 1, 30);
    return { log: true, low: Math.log10(0.05), high: Math.log10(1.5 * top) };
  }
  if (lane.key === "match") return { low: 0, high: 1 };
  return { low: 0, high: 1.15 * Math.max(high, lane.limit || 0, 1e-9) };
}

function plotY(plot, value) {
  const { low, high, log } = plot.range;
  const shown = log ? Math.log10(Math.max(value, 10 ** low)) : value;
  return plot.top + PLOT - (Math.min(Math.max((shown - low) / (high - low), 0), 1)) * PLOT;
}

// The curve, broken where nothing is known, and the areas between it and the lower edge.
function curveOf(layout, plot, end) {
  const { lane } = plot;
  const line = new Path2D();
  const area = new Path2D();
  const floor = plot.top + (lane.key === "match" ? 0 : PLOT);
  const held = heldFor(lane);
  let lastX = null;
  for (let i = 0; i < lane.t.length; i++) {
    const value = lane.values[i];
    const x = timeToX(layout, end, lane.t[i]);
    const broken = !Number.isFinite(value) || (i > 0 && lane.t[i] - lane.t[i - 1] > held);
    if (broken && lastX !== null) { area.lineTo(lastX, floor); area.closePath(); lastX = null; }
    if (!Number.isFinite(value)) continue;
    const y = plotY(plot, value);
    if (lastX === null) { line.moveTo(x - 0.5, y); area.moveTo(x - 0.5, floor); area.lineTo(x - 0.5, y); }
    line.lineTo(x, y);
    area.lineTo(x, y);
    lastX = x;
  }
  if (lastX !== null) { area.lineTo(lastX, floor); area.closePath(); }
  return { line, area };
}

function fillBeyond(context, layout, plot, curve, inks) {
  const y = plotY(plot, plot.lane.limit);
  context.save();
  context.beginPath();
  if (plot.lane.key === "match") context.rect(layout.left, y, layout.right - layout.left, plot.top + PLOT - y);
  else context.rect(layout.left, plot.top, layout.right - layout.left, y - plot.top);
  context.clip();
  context.fillStyle = inks.error;
  context.globalAlpha = 0.35;
  context.fill(curve.area);
  context.restore();
}

// What lies under the pointer, in words.
function lanesTip(player, x, y) {
  const { scene, course: { layout } } = player;
  const end = scene.head.end_s || 1;
  const t = xToTime(layout, end, x);
  const within = (part) => y >= part.top - part.title && y < part.top + part.height + 4;
  if (within(layout.band)) { const state = stateAt(scene, t); return `${clockText(t)}: ${state ? state[1] : ""}`; }
  const row = layout.rows.find(within);
  if (row) {
    const reach = (9 / (layout.right - layout.left)) * end;
    const marks = scene.head.marks.filter((mark) => mark.kind === row.kind
      && mark.t - reach <= t && t <= (mark.end === null ? mark.t : mark.end) + reach);
    return marks.slice(0, 3).map((mark) => `${clockText(mark.t)}: ${mark.title}`).join("\n") || clockText(t);
  }
  const plot = layout.plots.find(within);
  return plot ? `${clockText(t)}: ${plot.lane.title} ${laneText(plot.lane, laneAt(plot.lane, t))}` : clockText(t);
}
