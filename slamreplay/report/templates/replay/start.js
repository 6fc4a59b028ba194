// The start: nothing is unpacked before somebody looks.

function start() {
  starting = starting || begin().catch((trouble) => { fail(trouble); return false; });
  return starting;
}

async function begin() {
  if (typeof DecompressionStream === "undefined") {
    throw new Error("this browser cannot unpack it (it lacks DecompressionStream)");
  }
  section.dataset.state = "loading";
  player.scene = sceneOf(await unpack(find("data").textContent));
  const { head } = player.scene;
  find("time").max = head.end_s;
  find("time").disabled = false;
  readInks();
  offerLayers();
  listen();
  sharpSize();
  moveTo(head.open_s);
  paint(true);
  section.dataset.state = "ready";
  return true;
}

function fail(trouble) {
  section.dataset.state = "failed";
  const told = find("trouble");
  told.hidden = false;
  told.textContent = `The replay cannot be shown: ${trouble.message}. The figures of this page show the same log, standing still.`;
}

function readInks() {
  player.inks = inksOf(section);
  redraw();
}

function sharpSize() {
  player.lanes.style.height = `${lanesHeight(section, player.lanes.clientWidth)}px`;
  player.view.width = player.map.clientWidth;
  player.view.height = player.map.clientHeight;
}

function listen() {
  listenToMap(player, redraw);
  listenToLanes(player, seek, redraw);
  player.map.addEventListener("pointerup", keepLink);
  section.addEventListener("keydown", onKey);
  const click = (id, act) => find(id).addEventListener("click", act);
  click("play", () => play(!player.playing));
  click("back-mark", () => stepMark(-1));
  click("next-mark", () => stepMark(1));
  click("back-scan", () => stepScan(-1));
  click("next-scan", () => stepScan(1));
  click("in", () => zoomBy(1.4));
  click("out", () => zoomBy(1 / 1.4));
  click("fit", fitAll);
  click("follow", () => followRobot(!player.following));
  click("measure", () => measure(!player.measuring));
  click("link", copyLink);
  find("time").addEventListener("input", (event) => seek(Number(event.target.value)));
  find("speed").addEventListener("change", (event) => { player.speed = Number(event.target.value); });
  section.addEventListener("change", (event) => { if (event.target.name === "layer") readLayers(); });
  new ResizeObserver(() => {
    if (section.hasAttribute("data-paper")) return; // what is drawn is stretched onto the paper
    sharpSize();
    redraw();
  }).observe(section);
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", readInks);
  new MutationObserver(readInks).observe(document.documentElement, { attributes: true });
  addEventListener("beforeprint", () => forPaper(true));
  addEventListener("afterprint", () => forPaper(false));
}

// On paper: the still of the moment in ink on white, with its words below it.
function forPaper(on) {
  if (player.playing) play(false);
  section.toggleAttribute("data-paper", on);
  player.inks = inksOf(section);
  player.course = null;
  paint(true);
}

player.lanes.style.height = `${lanesHeight(section, player.lanes.clientWidth)}px`;
if (section.clientWidth < NARROW) find("shown").open = false; // a phone has no room for all of it
addEventListener("hashchange", () => follow(location.hash));
// The same link twice changes no address, and still asks for its moment.
document.addEventListener("click", (event) => {
  const link = event.target.closest && event.target.closest('a[href^="#t="]');
  if (link && link.hash === location.hash) follow(link.hash);
});
section.addEventListener("focusin", start, { once: true });
if (asked(location.hash)) follow(location.hash);
else {
  const near = new IntersectionObserver((seen) => {
    if (!seen.some((one) => one.isIntersecting)) return;
    near.disconnect();
    (window.requestIdleCallback || setTimeout)(start);
  }, { rootMargin: "150px" });
  near.observe(section);
}
