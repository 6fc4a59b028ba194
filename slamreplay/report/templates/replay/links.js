// Links to a moment: #t=42.3&x=1.2&y=3.4&z=12, z being the metres across the map.

function hashOf() {
  const { view } = player;
  const place = view.fitted ? "" : `&x=${view.x.toFixed(2)}&y=${view.y.toFixed(2)}&z=${(view.width / view.scale).toFixed(2)}`;
  return `#t=${Number(player.t.toFixed(2))}${place}`;
}

function keepLink() {
  clearTimeout(linkTimer);
  if (player.playing) return;
  linkTimer = setTimeout(() => {
    try { history.replaceState(null, "", hashOf()); } catch { /* a page without an address */ }
  }, 300);
}

function asked(hash) {
  const wanted = new URLSearchParams(hash.replace(/^#/, ""));
  const number = (name) => (wanted.has(name) && wanted.get(name) !== "" ? Number(wanted.get(name)) : NaN);
  const [t, x, y, z] = ["t", "x", "y", "z"].map(number);
  return Number.isFinite(t) ? { t, x, y, z } : null;
}

async function follow(hash) {
  const wanted = asked(hash);
  if (!wanted || !(await start())) return;
  if (player.playing) play(false);
  if (Number.isFinite(wanted.x + wanted.y) && wanted.z > 0) {
    sharpSize();
    Object.assign(player.view, { x: wanted.x, y: wanted.y, scale: Math.min(player.view.width / wanted.z, MOST_SCALE), fitted: false });
  }
  clearTimeout(linkTimer);
  moveTo(wanted.t);
  redraw();
  section.scrollIntoView({ block: "start", behavior: "auto" });
  player.map.focus({ preventScroll: true });
}

async function copyLink() {
  const link = location.href.replace(/#.*$/, "") + hashOf();
  let copied = true;
  try { await navigator.clipboard.writeText(link); } catch { copied = false; }
  player.tell(copied ? `Copied: ${hashOf()}` : `Link to this moment: ${link}`);
}
