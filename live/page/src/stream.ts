// One picture that the program keeps sending. A browser says nothing when such a stream ends: it is watched, and begun again.

const beginMs = 500;
const longestMs = 8000;
const stillMs = 4000;
const sample = { width: 96, height: 80 };

export class Stream {
  private wait = beginMs;
  private timer: ReturnType<typeof setTimeout> | undefined;
  private number = 0;
  private print = 0;
  private changed = 0;
  private frames = -1;
  private framesThen = -1;
  private readonly canvas = document.createElement('canvas');
  private readonly context: CanvasRenderingContext2D | null;
  private paused = true;

  constructor(private readonly image: HTMLImageElement, private readonly path: string) {
    this.canvas.width = sample.width;
    this.canvas.height = sample.height;
    this.context = this.canvas.getContext('2d', { willReadFrequently: true });
    if (this.context) this.context.imageSmoothingEnabled = false;
    image.addEventListener('error', () => this.later());
    image.addEventListener('load', () => {
      this.wait = beginMs;
    });
  }

  /** A hidden window leaves its connections to the others: a browser has six for one program. */
  pause(): void {
    this.paused = true;
    clearTimeout(this.timer);
    this.timer = undefined;
    this.image.removeAttribute('src');
  }

  begin(): void {
    this.paused = false;
    clearTimeout(this.timer);
    this.timer = undefined;
    this.changed = performance.now();
    this.framesThen = this.frames;
    this.image.src = `${this.path}?n=${++this.number}`;
  }

  private later(): void {
    if (this.paused || this.timer !== undefined) return;
    this.timer = setTimeout(() => this.begin(), this.wait);
    this.wait = Math.min(longestMs, 2 * this.wait);
  }

  count(frames: number): void {
    this.frames = frames;
  }

  /** Once a second: true if the picture stands still although the camera sends frames. */
  watch(): boolean {
    if (this.paused || !this.context) return false;
    const now = performance.now();
    const print = this.fingerprint();
    if (print !== this.print || this.frames - this.framesThen < 5) {
      if (print !== this.print) this.framesThen = this.frames;
      this.print = print;
      this.changed = now;
      return false;
    }
    const still = now - this.changed > stillMs;
    if (still) this.later();
    return still;
  }

  private fingerprint(): number {
    if (!this.context || !this.image.naturalWidth) return 0;
    this.context.drawImage(this.image, 0, 0, sample.width, sample.height);
    const pixels = new Uint32Array(this.context.getImageData(0, 0, sample.width, sample.height).data.buffer);
    let sum = 0;
    for (const pixel of pixels) sum = (Math.imul(sum, 31) + pixel) | 0;
    return sum;
  }
}
