// Hands on the canvases: drag, wheel and two fingers on the map; seeking on the timeline.

const CLICK_PX = 5; // a drag shorter than this was a click

function listenToMap(player, redraw) {
  const { map, view } = player;
  const fingers = new Map();
  let travelled = 0;
  const at = (event) => { const box = map.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
  map.addEventListener("pointerdown", (event) => {
    if (event.button > 0) return;
    map.setPointerCapture(event.pointerId);
    fingers.set(event.pointerId, at(event));
    travelled = 0;
  });
  map.addEventListener("pointermove", (event) => {
    const now = at(event);
    player.pointer = event.pointerType === "touch" ? player.pointer : now;
    const before = fingers.get(event.pointerId);
    if (before) {
      const others = [...fingers].filter(([id]) => id !== event.pointerId).map(([, place]) => place);
      if (others.length) pinch(before, now, others[0]);
      else if (travelled + Math.hypot(now[0] - before[0], now[1] - before[1]) > CLICK_PX) {
        if (player.following) followRobot(false);
        pan(view, now[0] - before[0], now[1] - before[1]);
      }
      travelled += Math.hypot(now[0] - before[0], now[1] - before[1]);
      fingers.set(event.pointerId, now);
    }
    redraw(true);
  });
  function pinch(before, now, other) {
    const span = (a) => Math.max(Math.hypot(a[0] - other[0], a[1] - other[1]), 1);
    zoom(view, span(now) / span(before), (now[0] + other[0]) / 2, (now[1] + other[1]) / 2, player.scene.head.window);
    pan(view, (now[0] - before[0]) / 2, (now[1] - before[1]) / 2);
    travelled = Infinity;
  }
  const lift = (event) => {
    const down = fingers.delete(event.pointerId);
    if (down && event.type === "pointerup" && travelled <= CLICK_PX && player.measuring) {
      addMeasured(player, toMap(view, ...at(event)));
    }
    redraw(true);
  };
  map.addEventListener("pointerup", lift);
  map.addEventListener("pointercancel", lift);
  map.addEventListener("pointerleave", () => { player.pointer = null; redraw(true); });
  map.addEventListener("dblclick", (event) => {
    if (player.measuring || !player.scene.head.window) return;
    zoom(view, 2, ...at(event), player.scene.head.window);
    redraw(true);
  });
  map.addEventListener("wheel", (event) => {
    // Without ctrl or focus the wheel scrolls the page, as everywhere else on it.
    if (!player.scene.head.window || !(event.ctrlKey || document.activeElement === map)) return;
    event.preventDefault();
    zoom(view, Math.exp(-event.deltaY * (event.deltaMode ? 0.05 : 0.0015)), ...at(event), player.scene.head.window);
    redraw(true);
  }, { passive: false });
}

function addMeasured(player, point) {
  player.measured = player.measured.length >= 2 ? [point] : [...player.measured, point];
  if (player.measured.length === 2) player.tell(`Measured ${distanceText(...player.measured)}.`);
}

function listenToLanes(player, seek, redraw) {
  const { lanes, tip } = player;
  const at = (event) => { const box = lanes.getBoundingClientRect(); return [event.clientX - box.left, event.clientY - box.top]; };
  const end = () => player.scene.head.end_s || 1;
  let [dragging, pressed] = [false, null];
  lanes.addEventListener("pointerdown", (event) => {
    if (event.button > 0) return;
    lanes.setPointerCapture(event.pointerId);
    pressed = at(event);
    if (event.pointerType === "touch") return; // a finger may be about to scroll the page
    dragging = true;
    seek(nearMark(player, ...pressed));
  });
  lanes.addEventListener("pointermove", (event) => {
    const [x, y] = at(event);
    if (pressed && Math.abs(x - pressed[0]) > CLICK_PX) dragging = true;
    if (dragging) seek(xToTime(player.course.layout, end(), x));
    player.hovered = dragging || event.pointerType === "touch" ? null : xToTime(player.course.layout, end(), x);
    tip.textContent = lanesTip(player, x, y);
    tip.hidden = dragging || event.pointerType === "touch";
    const room = lanes.clientWidth - tip.offsetWidth - 4;
    tip.style.left = `${Math.max(Math.min(x + 14, room), 0)}px`;
    tip.style.top = `${y + 18}px`;
    redraw();
  });
  lanes.addEventListener("pointerup", (event) => {
    if (pressed && !dragging) seek(nearMark(player, ...pressed));
    lift(event);
  });
  const lift = () => {
    [dragging, pressed] = [false, null];
    tip.hidden = true;
    player.hovered = null;
    redraw();
  };
  for (const kind of ["pointercancel", "pointerleave"]) lanes.addEventListener(kind, lift);
}

// A click on a mark goes to its moment, not to the pixel beside it.
function nearMark(player, x, y) {
  const { course: { layout }, scene } = player;
  const end = scene.head.end_s || 1;
  const row = layout.rows.find((one) => y >= one.top && y < one.top + one.height);
  const marks = row ? scene.head.marks.filter((mark) => mark.kind === row.kind) : [];
  const off = (mark) => Math.abs(timeToX(layout, end, mark.t) - x);
  const nearest = marks.sort((a, b) => off(a) - off(b))[0];
  return nearest && off(nearest) < 9 ? nearest.t : xToTime(layout, end, x);
}
