// What keys do, in one table: for the handler and for the sheet of keys. As in the window of ClipGStream Studio.

const GESTURES = [
  ["Drag, one finger", "Orbit"],
  ["Right drag, Shift+drag, two fingers", "Pan"],
  ["Wheel, pinch", "Zoom"],
  ["Double click, double tap", "Centre what is there"],
];

function keyTable(player) {
  const { clock, header } = player, second = Math.max(1, Math.round(clock.fps));
  return [
    [["Space"], "Play or pause", () => player.play(!clock.isPlaying)],
    [["ArrowLeft", ","], "One frame back", () => player.go(clock.frame - 1)],
    [["ArrowRight", "."], "One frame forward", () => player.go(clock.frame + 1)],
    [["Shift+ArrowLeft"], "One second back", () => player.go(clock.frame - second)],
    [["Shift+ArrowRight"], "One second forward", () => player.go(clock.frame + second)],
    [["Home"], "First frame", () => player.go(0)],
    [["End"], "Last frame", () => player.go(clock.nFrames - 1)],
    [["ArrowUp"], "Start of this or the previous clip", () => player.goToClip(-1)],
    [["ArrowDown"], "Start of the next clip", () => player.goToClip(1)],
    [["Shift+<", "<"], "Slower", () => player.changeSpeed(-1)],
    [["Shift+>", ">"], "Faster", () => player.changeSpeed(1)],
    [["Ctrl+/"], "Loop on or off", () => player.loop(!clock.isLooping)],
    [["f"], "The whole scene", () => player.look(null, true)],
    [["["], "Previous camera", () => player.nextCamera(-1)],
    [["]"], "Next camera", () => player.nextCamera(1)],
    [["1"], "Camera by number, 1 to 9", () => player.look(0)],
    ...header.cameras.slice(1, 9).map((_, i) => [[`${i + 2}`], "", () => player.look(i + 1)]),
    [["Enter"], "Fill the screen", () => player.fillScreen()],
    [["?", "Shift+?", "F1"], "Keys and mouse", () => player.help()],
  ];
}

/** Keys act wherever the focus is, but in a list or on a button those that belong to it are left to it. */
function followKeys(table) {
  const actions = new Map(table.flatMap(([keys, , act]) => keys.map((key) => [key, act])));
  document.addEventListener("keydown", (event) => {
    if (event.altKey || event.metaKey || document.getElementById("keys").open) return;
    const letter = event.key === " " ? "Space" : event.key;
    const name = letter.length === 1 ? letter.toLowerCase() : letter;
    const key = `${event.ctrlKey ? "Ctrl+" : ""}${event.shiftKey ? "Shift+" : ""}${name}`;
    const act = actions.get(key);
    const { tagName } = document.activeElement || {};
    if (!act || tagName === "SELECT" || (tagName === "BUTTON" && (name === "Enter" || name === "Space"))) return;
    event.preventDefault();
    act();
  });
}

function fillKeySheet(table) {
  const sheet = document.getElementById("key-table");
  const names = { ArrowLeft: "Left", ArrowRight: "Right", ArrowUp: "Up", ArrowDown: "Down", f: "F" };
  const shown = (key) => key.replace(/^Shift\+(?=[<>?])/, "").split("+").map((part) => names[part] || part).join("+");
  for (const [keys, does] of [...table, ...GESTURES.map(([gesture, does]) => [[gesture], does])]) {
    if (!does) continue;
    const row = sheet.insertRow();
    row.insertCell().textContent = [...new Set(keys.map(shown))].join(", ");
    row.insertCell().textContent = does;
  }
}
