import { Color } from 'three';

// From calm to alarming; the same stops as the plots of the report (report/detail/colour.cc).
const stops: [number, string][] = [
  [0.0, '#2c7bb6'],
  [0.35, '#35a9a1'],
  [0.6, '#9cbf4b'],
  [0.8, '#f0a33a'],
  [1.0, '#d7301f'],
];

export function colourOf(fraction: number): Color {
  const at = Math.min(1, Math.max(0, Number.isFinite(fraction) ? fraction : 0));
  for (let i = 1; i < stops.length; i++) {
    const [low, from] = stops[i - 1]!;
    const [high, to] = stops[i]!;
    if (at <= high) return new Color(from).lerp(new Color(to), (at - low) / (high - low));
  }
  return new Color(stops[stops.length - 1]![1]);
}

/** A variable of the page's style sheet, so that the view follows light and dark. */
export function themeColour(name: string, fallback: string): Color {
  const value = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  return new Color(value || fallback);
}
