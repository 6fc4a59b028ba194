// What leads through the map: paths, plans, particles and stops.

// What lies behind is strong, what lies ahead faint; the pen is lifted where no pose is known.
function drawPath(context, view, track, t, colour, dashed) {
  if (!track) return;
  const now = rowAt(track.t, t);
  context.strokeStyle = colour;
  context.lineJoin = "round";
  context.setLineDash(dashed ? [6, 3] : []);
  for (const [from, to, alpha, line] of [[now, track.t.length - 1, 0.28, 1.6], [0, now, 0.95, 2.2]]) {
    context.globalAlpha = alpha;
    context.lineWidth = line;
    context.beginPath();
    let [lastX, lastY] = [NaN, NaN];
    for (let i = Math.max(from, 0); i <= to; i++) {
      const px = view.width / 2 + (track.x[i] - view.x) * view.scale;
      const py = view.height / 2 - (track.y[i] - view.y) * view.scale;
      if (track.gap[i] || i === Math.max(from, 0)) context.moveTo(px, py);
      else if (Math.abs(px - lastX) + Math.abs(py - lastY) < 0.7) continue; // less than a pixel
      else context.lineTo(px, py);
      [lastX, lastY] = [px, py];
    }
    context.stroke();
  }
  context.globalAlpha = 1;
  context.setLineDash([]);
}

function drawPlan(context, player) {
  const { scene: { plans, head }, view, inks, t } = player;
  const row = rowAt(plans.t, t);
  if (row < 0) return;
  const n = plans.xy.shape[1];
  context.strokeStyle = inks.plan;
  context.lineWidth = 2.4;
  context.setLineDash([1, 4]);
  context.lineCap = "round";
  context.beginPath();
  for (let i = plans.first[row]; i < plans.first[row + 1]; i++) {
    const x = head.origin[0] + plans.xy[i] * head.point_m;
    const y = head.origin[1] + plans.xy[n + i] * head.point_m;
    context.lineTo(...toScreen(view, x, y));
  }
  context.stroke();
  context.setLineDash([]);
  context.lineCap = "butt";
}

function drawParticles(context, player) {
  const { scene: { particles, head }, view, inks, t } = player;
  const row = currentRow(particles, t);
  if (row < 0) return;
  const n = particles.xy.shape[1];
  const length = Math.min(Math.max(0.14 * view.scale, 4), 12);
  context.strokeStyle = inks.particles;
  context.globalAlpha = 0.55;
  context.lineWidth = 1.2;
  context.beginPath();
  for (let i = particles.first[row]; i < particles.first[row + 1]; i++) {
    const x = head.origin[0] + particles.xy[i] * head.point_m;
    const y = head.origin[1] + particles.xy[n + i] * head.point_m;
    const [px, py] = toScreen(view, x, y);
    const yaw = particles.turn[i] * head.turn_rad;
    context.moveTo(px, py);
    context.lineTo(px + length * Math.cos(yaw), py - length * Math.sin(yaw));
  }
  context.stroke();
  context.globalAlpha = 1;
}

function drawStops(context, player) {
  const { scene, view, inks } = player;
  context.textAlign = "center";
  context.font = `700 11px ${inks.font}`;
  for (const stop of scene.head.stops) {
    const [x, y] = toScreen(view, stop.x, stop.y);
    context.beginPath();
    context.arc(x, y, 9, 0, 2 * Math.PI);
    context.fillStyle = inks.ink;
    context.strokeStyle = inks.paper;
    context.lineWidth = 2;
    context.fill();
    context.stroke();
    context.fillStyle = inks.paper;
    context.fillText(String(stop.number), x, y + 0.5);
  }
  context.textAlign = "left";
  context.font = `600 12px ${inks.font}`;
}
