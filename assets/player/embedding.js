// The page within another page: what its address asks for, and what the page around it may say. In docs/exporting.md.

/** Of an address such as "#t=2.5&camera=cam3&autoplay": {t: seconds, camera: name or number, autoplay: true}. */
function wishesOf(fragment) {
  const given = new URLSearchParams(fragment.replace(/^#/, "")), seconds = Number.parseFloat(given.get("t"));
  return {
    t: Number.isFinite(seconds) ? seconds : null,
    camera: given.get("camera"),
    autoplay: given.has("autoplay") && given.get("autoplay") !== "0",
  };
}

function followAddress(player) {
  const follow = () => {
    const { t, camera, autoplay } = wishesOf(location.hash), { cameras } = player.header;
    const named = cameras.findIndex(({ name }) => name === camera), numbered = /^\d+$/.test(camera || "") ? Number(camera) : -1;
    if (camera !== null) player.look(named >= 0 ? named : numbered < cameras.length && numbered >= 0 ? numbered : null);
    if (t !== null) player.goToSecond(t);
    if (autoplay && !matchMedia("(prefers-reduced-motion: reduce)").matches) player.play(true);
  };
  addEventListener("hashchange", follow);
  follow();
}

/**
 * The page around this one, whoever it is, may play, pause and seek, by {clipgstream: "play" | "pause"} and
 * {clipgstream: "seek", t: seconds}. Nothing else is understood, and nothing is told, so no page needs to be trusted.
 */
function followEmbedder(player) {
  addEventListener("message", ({ source, data }) => {
    if (source !== parent || source === window || data === null || typeof data !== "object") return;
    const { clipgstream: wish, t, ...rest } = data;
    if (Object.keys(rest).length || (t !== undefined) !== (wish === "seek")) return;
    if (wish === "play" || wish === "pause") player.play(wish === "play");
    else if (wish === "seek" && Number.isFinite(t)) player.goToSecond(t);
  });
}
