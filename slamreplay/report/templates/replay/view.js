// Which part of the map is seen: its middle in metres, and how many pixels a metre takes.

const MOST_SCALE = 800; // px/m
const ROBOT_SCALE = 34; // px/m at the least when the robot is followed

function toScreen(view, x, y) {
  return [view.width / 2 + (x - view.x) * view.scale, view.height / 2 - (y - view.y) * view.scale];
}

function toMap(view, px, py) {
  return { x: view.x + (px - view.width / 2) / view.scale, y: view.y - (py - view.height / 2) / view.scale };
}

function fit(view, box) {
  const [x0, y0, x1, y1] = box;
  view.x = (x0 + x1) / 2;
  view.y = (y0 + y1) / 2;
  view.scale = Math.min(view.width / (x1 - x0), view.height / (y1 - y0), MOST_SCALE);
  view.fitted = true;
}

// Zoom by a factor so that the point under the pointer stays where it is.
function zoom(view, factor, px, py, box) {
  const fixed = toMap(view, px, py);
  const whole = Math.min(view.width / (box[2] - box[0]), view.height / (box[3] - box[1]));
  view.scale = Math.min(Math.max(view.scale * factor, whole / 4), MOST_SCALE);
  const now = toMap(view, px, py);
  view.x += fixed.x - now.x;
  view.y += fixed.y - now.y;
  view.fitted = false;
}

function pan(view, dx, dy) {
  view.x -= dx / view.scale;
  view.y += dy / view.scale;
  view.fitted = false;
}

// A length that is round and about a sixth of the width, for the scale bar.
function scaleBar(view) {
  const about = view.width / 6 / view.scale;
  const power = 10 ** Math.floor(Math.log10(about));
  const metres = [5, 2, 1].map((n) => n * power).find((n) => n <= about) || power;
  const text = metres >= 1 ? `${metres} m` : metres >= 0.01 ? `${Math.round(100 * metres)} cm` : `${Math.round(1000 * metres)} mm`;
  return { px: metres * view.scale, text };
}
