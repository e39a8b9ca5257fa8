import { drawing, mark } from './dom';
import { percent } from './format';
import type { Camera } from './state';

const width = 256;
const height = 64;

/** Grey level below which half of all pixels lie, as a share of white. */
function median(histogram: readonly number[]): number | null {
  const total = histogram.reduce((sum, share) => sum + share, 0);
  let sum = 0;
  for (let i = 0; i < histogram.length; i++) {
    sum += histogram[i]!;
    if (total > 0 && sum >= total / 2) return (i + 0.5) / histogram.length;
  }
  return null;
}

/** Share of pixels over grey level, on a square-root scale: a few lost pixels must show beside a wall that fills the picture. */
export class Histogram {
  readonly root = drawing('svg', { viewBox: `0 0 ${width} ${height}`, class: 'histogram', role: 'img', preserveAspectRatio: 'none' });
  private readonly bars = drawing('path', { class: 'bars' });
  private readonly low = drawing('path', { class: 'low' });
  private readonly high = drawing('path', { class: 'high' });

  constructor() {
    this.root.append(this.low, this.high, this.bars);
  }

  update(camera: Camera): void {
    const shares = camera.histogram.map((share) => Math.sqrt(Math.max(0, Number(share) || 0)));
    const top = Math.max(...shares, 1e-9);
    const step = width / Math.max(1, shares.length);
    let path = `M0 ${height}`;
    shares.forEach((share, i) => {
      const y = (height - (share / top) * (height - 4)).toFixed(1);
      path += `L${(i * step).toFixed(1)} ${y}H${((i + 1) * step).toFixed(1)}`;
    });
    mark(this.bars, 'd', `${path}V${height}Z`);
    mark(this.low, 'd', camera.dark !== null && camera.dark > 0 ? `M0 0H${step}V${height}H0Z` : 'M0 0');
    mark(this.high, 'd', camera.saturated !== null && camera.saturated > 0 ? `M${width - step} 0H${width}V${height}H${width - step}Z` : 'M0 0');
    const middle = median(camera.histogram);
    mark(this.root, 'aria-label', middle === null
      ? 'Histogram of grey levels: nothing yet'
      : `Histogram of grey levels: median ${percent(middle, 0)} of white, ${percent(camera.saturated)} saturated, ${percent(camera.dark)} dark`);
  }
}
