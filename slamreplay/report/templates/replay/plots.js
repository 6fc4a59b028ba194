// One lane: its curve, its limit, and where it is beyond that.

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
  for (const [state, , from, to] of scene.head.states) {
    if (state === "healthy") continue;
    context.globalAlpha = 0.12;
    context.fillStyle = inks[`state-${state}`];
    context.fillRect(timeToX(layout, end, from), top, timeToX(layout, end, to) - timeToX(layout, end, from), PLOT);
    context.globalAlpha = 1;
  }
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
  drawExtreme(context, layout, plot, inks);
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

// The lane's scale: how high its curve goes, of the match how low.
function drawExtreme(context, layout, plot, inks) {
  const { lane } = plot;
  const known = lane.values.filter(Number.isFinite);
  if (!known.length) return;
  const [word, pick] = lane.key === "match" ? ["least", Math.min] : ["most", Math.max];
  const value = known.reduce((a, b) => pick(a, b));
  const text = `${word} ${laneText(lane, value)}`;
  context.font = `11px ${inks.font}`;
  if (layout.narrow) { haloed(context, text, layout.left + 4, plot.top + PLOT - 8, inks, inks.soft); return; }
  context.fillStyle = inks.soft;
  context.fillText(text, GUTTER - 12 - context.measureText(text).width, plot.top + PLOT - 9);
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
