// Mouse, pen and fingers over the picture.

const ZOOM_PER_PX = 1.0015;
const PX_PER_LINE = 33; // of wheels that count lines
const PX_PER_PAGE = 400;
const TAP_PX = 20, TAP_MS = 350; // farther or longer is no tap, and the next one no second tap

/**
 * Dragging orbits; the right button, the middle one, Shift or two fingers pan; wheel and pinching zoom; a
 * double tap centres. */
function followPointer(canvas, view, onChange) {
  const pointers = new Map();
  let tap = null; // where and when the last one was

  const middle = () => {
    const places = [...pointers.values()], n = places.length;
    const x = places.reduce((total, place) => total + place.x, 0) / n;
    const y = places.reduce((total, place) => total + place.y, 0) / n;
    return { x, y, spread: n > 1 ? Math.hypot(places[0].x - places[1].x, places[0].y - places[1].y) : 0 };
  };

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, { x: event.clientX, y: event.clientY, pans: event.button > 0, begun: event });
    canvas.focus({ preventScroll: true });
    event.preventDefault();
  });
  canvas.addEventListener("pointermove", (event) => {
    const pointer = pointers.get(event.pointerId);
    if (!pointer) return;
    const before = middle();
    pointer.x = event.clientX;
    pointer.y = event.clientY;
    const after = middle(), dx = after.x - before.x, dy = after.y - before.y;
    if (pointers.size > 1 || pointer.pans || event.shiftKey) view.pan(dx, dy, canvas.clientWidth, canvas.clientHeight);
    else view.orbit(dx, dy);
    if (before.spread > 0 && after.spread > 0) view.dolly(before.spread / after.spread);
    onChange();
  });
  const isNear = (a, b) =>
    Math.hypot(a.clientX - b.clientX, a.clientY - b.clientY) < TAP_PX && Math.abs(a.timeStamp - b.timeStamp) < TAP_MS;
  const release = (event) => pointers.delete(event.pointerId);
  canvas.addEventListener("pointerup", (event) => {
    const pointer = pointers.get(event.pointerId), isTap = pointer && pointers.size === 1 && !pointer.pans && isNear(pointer.begun, event);
    release(event);
    if (isTap && tap && isNear(tap, event)) {
      const { left, top, width, height } = canvas.getBoundingClientRect();
      view.pan(left + width / 2 - event.clientX, top + height / 2 - event.clientY, width, height);
      onChange();
    }
    tap = isTap && !(tap && isNear(tap, event)) ? event : null;
  });
  canvas.addEventListener("pointercancel", release);
  canvas.addEventListener("lostpointercapture", release);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const unit = [1, PX_PER_LINE, PX_PER_PAGE][event.deltaMode];
      view.dolly(ZOOM_PER_PX ** Math.max(-400, Math.min(400, event.deltaY * unit)));
      onChange();
    },
    { passive: false },
  );
}
