// Buttons and lists below the picture.

function fillControls(player) {
  const title = document.getElementById("title"), by = (id) => document.getElementById(id);
  title.textContent = player.header.title;
  document.title = player.header.title;
  const option = (value, text) => {
    const made = document.createElement("option");
    made.value = value;
    made.textContent = text;
    return made;
  };
  by("speed").append(...SPEEDS.map((speed) => option(speed, `${speed}\u00d7`)));
  by("camera").append(option("", "Free"), ...player.header.cameras.map((camera, i) => option(i, camera.name)));
  by("play").onclick = () => player.play(!player.clock.isPlaying);
  by("loop").onclick = () => player.loop(!player.clock.isLooping);
  by("home").onclick = () => player.look(null, true);
  by("full").onclick = () => player.fillScreen();
  by("help").onclick = () => player.help();
  by("speed").onchange = (event) => {
    player.clock.speed = Number(event.target.value);
    player.changed();
  };
  by("quality").append(...["auto", "low", "full"].map((name) => option(name, name[0].toUpperCase() + name.slice(1))));
  by("quality").onchange = ({ target }) => {
    player.pictures.quality = target.value;
    player.changed();
  };
  by("again").onclick = () => player.pictures.loader.again();
  addEventListener("online", () => player.pictures.loader.again());
  for (const id of ["speed", "camera", "quality"]) leaveWhenChosen(by(id), () => player.canvas.focus());
  by("camera").onchange = ({ target }) => player.look(target.value === "" ? null : Number(target.value));
}

/** A list that was used with the pointer gives the keys back; one that was reached by keys keeps them. */
function leaveWhenChosen(list, leave) {
  let isPointed = false;
  list.addEventListener("pointerdown", () => (isPointed = true));
  list.addEventListener("keydown", () => (isPointed = false));
  list.addEventListener("change", () => isPointed && leave());
}
