// The map at one moment: what is drawn, and in which order.

function drawMap(player) {
  const { scene, view, inks, layers, t } = player;
  const { context, width, height } = sharp(player.map);
  if (!width || !height) return; // not laid out: on paper before it was ready, or without a map
  view.width = width;
  view.height = height;
  if (!scene.head.window) return;
  if (view.fitted) fit(view, scene.head.window);
  const poses = posesAt(scene, t);
  const followed = poses.hindsight || poses.belief || poses.odometry;
  if (player.following && followed) { view.x = followed.x; view.y = followed.y; }
  context.fillStyle = inks[scene.ground && layers.has("map") ? "unknown" : "free"];
  context.fillRect(0, 0, width, height);
  context.font = `600 12px ${inks.font}`;
  context.textAlign = "left";
  context.textBaseline = "middle";
  if (scene.ground) drawGround(context, player);
  if (layers.has("changes")) drawRegions(context, player);
  for (const name of ["odometry", "hindsight", "belief"]) {
    if (layers.has(name)) drawPath(context, view, scene.tracks[name], t, inks[name], name === "belief");
  }
  if (layers.has("plan") && scene.plans) drawPlan(context, player);
  if (layers.has("particles") && scene.particles) drawParticles(context, player);
  drawScans(context, player);
  if (layers.has("stops")) drawStops(context, player);
  for (const name of ["odometry", "hindsight", "belief"]) {
    if (!poses[name] || !layers.has(name)) continue;
    if (layers.has("uncertainty")) drawUncertainty(context, player, name, poses[name]);
  }
  if (layers.has("belief") && layers.has("hindsight")) drawLink(context, player, poses);
  for (const name of ["odometry", "hindsight", "belief"]) {
    if (poses[name] && layers.has(name)) drawRobot(context, player, name, poses[name]);
  }
  if (player.measuring) drawMeasure(context, player);
  drawScaleBar(context, player);
}

function posesAt(scene, t) {
  return Object.fromEntries(Object.entries(scene.tracks).map(([name, track]) => [name, poseAt(track, t)]));
}

function drawMeasure(context, player) {
  const { view, inks, measured, pointer } = player;
  const ends = measured.length === 1 && pointer ? [...measured, toMap(view, ...pointer)] : measured;
  context.strokeStyle = context.fillStyle = inks.ink;
  const cross = (x, y) => {
    context.beginPath();
    context.moveTo(x - 7, y); context.lineTo(x + 7, y);
    context.moveTo(x, y - 7); context.lineTo(x, y + 7);
    context.lineWidth = 4; context.strokeStyle = inks.paper; context.stroke();
    context.lineWidth = 1.6; context.strokeStyle = inks.ink; context.stroke();
  };
  if (ends.length < 2 && !pointer) cross(view.width / 2, view.height / 2);
  for (const end of ends) cross(...toScreen(view, end.x, end.y));
  if (ends.length < 2) return;
  const [[x0, y0], [x1, y1]] = ends.map((end) => toScreen(view, end.x, end.y));
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.lineWidth = 1.6;
  context.setLineDash([7, 4]);
  context.stroke();
  context.setLineDash([]);
  const text = distanceText(ends[0], ends[1]);
  const wide = context.measureText(text).width;
  const at = Math.min(Math.max((x0 + x1) / 2 - wide / 2, 8), view.width - wide - 8);
  label(context, text, at, Math.min(Math.max((y0 + y1) / 2 - 18, 14), view.height - 14), wide, inks);
}

function drawScaleBar(context, player) {
  const { view, inks } = player;
  const bar = scaleBar(view);
  const [x, y] = [14, view.height - 14];
  for (const [line, colour] of [[5, inks.paper], [2, inks.ink]]) {
    context.beginPath();
    context.moveTo(x, y - 5); context.lineTo(x, y); context.lineTo(x + bar.px, y); context.lineTo(x + bar.px, y - 5);
    context.lineWidth = line;
    context.strokeStyle = colour;
    context.stroke();
  }
  haloed(context, bar.text, x + bar.px + 8, y - 2, inks);
}
