// Keys: only while something of the replay has the focus.

const KEYS = {
  " ": () => play(!player.playing), k: () => play(!player.playing),
  ArrowLeft: (event) => (event.shiftKey ? stepScan(-1) : seek(player.t - 1)),
  ArrowRight: (event) => (event.shiftKey ? stepScan(1) : seek(player.t + 1)),
  Home: () => seek(0), End: () => seek(player.scene.head.end_s),
  n: () => stepMark(1), p: () => stepMark(-1),
  "+": () => zoomBy(1.4), "=": () => zoomBy(1.4), "-": () => zoomBy(1 / 1.4), 0: fitAll,
  w: () => panBy(0, 60), s: () => panBy(0, -60), a: () => panBy(60, 0), d: () => panBy(-60, 0),
  f: () => followRobot(!player.following), m: () => measure(!player.measuring), l: copyLink,
  "?": () => { const help = find("help"); help.open = !help.open; },
};
const NUMBERED = {
  1: ["belief", "odometry"], 2: ["hindsight"], 3: ["scan-belief"], 4: ["scan-hindsight"],
  5: ["uncertainty"], 6: ["particles"], 7: ["plan"], 8: ["changes"], 9: ["map"],
};

function onKey(event) {
  if (!player.scene || event.ctrlKey || event.altKey || event.metaKey) return;
  const own = event.target.tagName; // what a control does with a key of its own stays so
  if (own === "SELECT" || own === "SUMMARY" && event.key !== "?") return;
  if ((own === "BUTTON" || own === "INPUT" && event.target.type === "checkbox") && event.key === " ") return;
  if (event.key === "Enter" && player.measuring && event.target === player.map) {
    addMeasured(player, { x: player.view.x, y: player.view.y });
    redraw(true);
  } else if (event.key === "Escape" && player.measuring) measure(false);
  else if (NUMBERED[event.key]) NUMBERED[event.key].forEach(toggleLayer);
  else {
    const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
    if (!Object.hasOwn(KEYS, key)) return;
    KEYS[key](event);
  }
  event.preventDefault();
}
