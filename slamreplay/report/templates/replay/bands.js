// What stands still on the timeline: its axis, the states and the marks.

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
