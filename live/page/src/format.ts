const none = '\u2013';

export function fixed(value: number | null | undefined, digits: number): string {
  if (typeof value !== 'number' || !Number.isFinite(value)) return none;
  const text = value.toFixed(digits);
  return text.startsWith('-') ? `\u2212${text.slice(1)}` : text;
}

export function percent(share: number | null | undefined, digits = 1): string {
  return typeof share === 'number' && Number.isFinite(share) ? `${fixed(100 * share, digits)} %` : none;
}

/** Three figures, without an exponent where a reader can do without. */
export function figures(value: number | null | undefined): string {
  if (typeof value !== 'number' || !Number.isFinite(value)) return none;
  if (value === 0) return '0';
  const size = Math.floor(Math.log10(Math.abs(value)));
  if (size < -6 || size > 7) return value.toExponential(2).replace('-', '\u2212');
  return fixed(value, Math.max(0, 2 - size));
}

export function age(seconds: number | null): string {
  if (seconds === null || !Number.isFinite(seconds)) return '';
  if (seconds < 1.5) return 'just now';
  if (seconds < 90) return `${Math.round(seconds)} s ago`;
  if (seconds < 5400) return `${Math.round(seconds / 60)} min ago`;
  return `${Math.round(seconds / 3600)} h ago`;
}

export function count(number: number, one: string, many = `${one}s`): string {
  return `${number} ${number === 1 ? one : many}`;
}

/** A number as people type it: comma or point, blanks allowed; null where it is none. */
export function typedNumber(text: string): number | null {
  const plain = text.trim().replace(',', '.').replace(/\u2212/g, '-');
  return /^[+-]?(\d+\.?\d*|\.\d+)$/.test(plain) ? Number(plain) : null;
}
