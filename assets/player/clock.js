// The playhead: where playing has come to. Knows frames and seconds, no pictures.

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4];

class Clock {
  constructor(nFrames, fps) {
    this.nFrames = nFrames;
    this.fps = fps;
    this.at = 0; // in frames
    this.speed = 1;
    this.isPlaying = false;
    this.isLooping = true;
    this.toldMs = null;
  }

  get frame() {
    return Math.min(Math.floor(this.at), this.nFrames - 1);
  }

  go(frame) {
    this.at = Math.max(0, Math.min(this.nFrames - 1, Math.round(frame)));
  }

  play(isPlaying) {
    if (isPlaying && this.nFrames < 2) return;
    if (isPlaying && !this.isLooping && this.frame === this.nFrames - 1) this.at = 0;
    this.isPlaying = isPlaying;
    this.toldMs = null;
  }

  /** Let time go on, unless what is to be shown is still on its way. */
  tell(nowMs, isWaiting) {
    const passedS = this.toldMs === null ? 0 : (nowMs - this.toldMs) / 1000;
    this.toldMs = nowMs;
    if (!this.isPlaying || isWaiting) return;
    this.at += passedS * this.fps * this.speed;
    if (this.at < this.nFrames) return;
    if (this.isLooping) {
      this.at %= this.nFrames;
    } else {
      this.go(this.nFrames - 1);
      this.isPlaying = false;
    }
  }

  faster(steps) {
    const place = SPEEDS.indexOf(this.speed) + steps;
    this.speed = SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, place))];
  }
}
