import { Keyed, byId, drawing, element, mark, say, show } from './dom';
import { count, figures, fixed } from './format';
import type { LogLine, Marker, State, Verdict } from './state';

interface Row {
  root: HTMLTableRowElement;
  cells: HTMLElement[];
}

function makeRow(kinds: string[]): Row {
  const root = element('tr');
  const cells = kinds.map((kind, i) => {
    const made = element(i === 0 ? 'th' : 'td', kind);
    if (i === 0) made.setAttribute('scope', 'row');
    return made;
  });
  root.append(...cells);
  return { root, cells };
}

// Of 1000 good values about one lies beyond (normal distribution).
const suspicious = 3.29;

export class MarkerTable {
  private readonly rows = new Keyed<Marker, Row>(
    byId('markers-rows'),
    () => makeRow(['n', '', '', 'n', 'n', 'n', 'n', 'n']),
    ({ root, cells }, marker) => {
      const seen = marker.left && marker.right ? 'both' : marker.left ? 'left' : marker.right ? 'right' : 'none';
      const xyz = [0, 1, 2].map((i) => fixed(marker.xyz_mm?.[i], 2));
      const sigma = marker.sigma_mm ? marker.sigma_mm.map((value) => fixed(value, 3)).join('  ') : '\u2013';
      const doubt = marker.w !== null && Math.abs(marker.w) > suspicious;
      [String(marker.id), marker.state, seen, ...xyz, sigma, fixed(marker.w, 1) + (doubt ? ' !' : '')].forEach((text, i) => say(cells[i]!, text));
      mark(root, 'data-level', doubt || marker.state === 'doubtful' ? 'warning' : null);
    });

  update(state: State): void {
    this.rows.update(state.markers, (marker) => String(marker.id));
    const some = state.markers.length > 0;
    show(byId('markers-none'), !some);
    show(byId('markers-doubt'), state.markers.some((marker) => marker.w !== null && Math.abs(marker.w) > suspicious));
    show(byId('markers-rows').closest<HTMLElement>('.table')!, some);
    say(byId('markers-frame'), state.frame === null ? '' : `in the frame of the ${state.frame === 'rig' ? 'rig (left camera)' : state.frame}`);
  }
}

const levelWords = { OK: '\u2713 OK', WARNING: '! Warning', FAIL: '\u2715 Fail', NONE: '\u2013' } as const;

export class Verdicts {
  private readonly rows = new Keyed<Verdict, Row>(
    byId('verdicts-rows'),
    () => makeRow(['level', '', 'n', 'n', 'prose']),
    ({ cells }, verdict) => {
      const unit = verdict.unit ? ` ${verdict.unit}` : '';
      const texts = [levelWords[verdict.level] ?? verdict.level, verdict.name,
        verdict.value === null ? '\u2013' : figures(verdict.value) + unit, verdict.limit === null ? '\u2013' : figures(verdict.limit) + unit, verdict.source];
      texts.forEach((text, i) => say(cells[i]!, text));
      mark(cells[0]!, 'data-level', String(verdict.level).toLowerCase());
    });
  private readonly links = new Keyed<{ href: string; text: string }, { root: HTMLLIElement; link: HTMLAnchorElement }>(
    byId('reports'),
    () => {
      const root = element('li');
      const link = element('a');
      link.target = '_blank';
      link.rel = 'noopener';
      root.append(link);
      return { root, link };
    },
    ({ link }, { href, text }) => {
      mark(link, 'href', href);
      say(link, text);
    });

  update(state: State): void {
    this.rows.update(state.verdicts, (verdict) => verdict.name);
    const some = state.verdicts.length > 0;
    show(byId('verdicts-none'), !some);
    show(byId('verdicts-rows').closest<HTMLElement>('.table')!, some);
    const links = state.stages
      .filter((stage) => stage.report !== null)
      .map((stage) => ({ href: resultPath(stage.report!), text: `Report: ${stage.title}` }))
      .filter((entry): entry is { href: string; text: string } => entry.href !== null);
    if (links.length > 0) links.unshift({ href: '/results/index.html', text: 'All results of this job' });
    this.links.update(links, (entry) => entry.href);
  }
}

/** Only files below /results/ of this program are linked. */
export function resultPath(path: string): string | null {
  try {
    const url = new URL(path, `${location.origin}/`);
    return url.origin === location.origin && url.pathname.startsWith('/results/') ? url.pathname : null;
  } catch {
    return null;
  }
}

/** What came to the log since the last time, also where the oldest lines have gone. */
export function newLines(before: readonly LogLine[], now: readonly LogLine[]): LogLine[] {
  const same = (a: LogLine, b: LogLine) => a.time === b.time && a.level === b.level && a.text === b.text;
  for (let gone = 0; gone < before.length; gone++) {
    const kept = before.length - gone;
    if (kept > now.length) continue;
    let equal = true;
    for (let i = 0; equal && i < kept; i++) equal = same(before[gone + i]!, now[i]!);
    if (equal) return now.slice(kept);
  }
  return [...now];
}

export class Log {
  private lines: readonly LogLine[] = [];
  private readonly list = byId('log');

  update(state: State): void {
    const added = newLines(this.lines, state.log);
    if (added.length === 0 && this.lines.length === state.log.length) return;
    const atEnd = this.list.scrollTop + this.list.clientHeight >= this.list.scrollHeight - 8;
    for (const line of added) {
      const item = element('p');
      item.dataset['level'] = line.level;
      const word = line.level === 'info' ? '' : line.level === 'error' ? 'Error: ' : 'Warning: ';
      item.append(element('time', '', line.time), element('span', '', word + line.text));
      this.list.append(item);
    }
    while (this.list.children.length > Math.max(state.log.length, 1)) this.list.firstElementChild!.remove();
    this.lines = state.log;
    if (atEnd) this.list.scrollTop = this.list.scrollHeight;
  }
}

/** Epipolar residual of each station with its sigma: a head that slips shows as a step. */
export class Drift {
  private drawn = '';

  update(state: State): void {
    const text = JSON.stringify(state.drift);
    if (text === this.drawn) return;
    this.drawn = text;
    const values = state.drift;
    const words = byId('drift-text');
    if (values.length === 0) {
      byId('drift').replaceChildren();
      say(words, 'Nothing measured yet.');
      return;
    }
    const width = 560;
    const height = 210;
    const [left, right, top, bottom] = [52, 12, 12, 40];
    const high = Math.max(...values.map((value) => value.epipolar_px + 2 * value.sigma_px), 0.01);
    const step = niceStep(high / 4);
    const end = step * Math.ceil(high / step);
    const x = (i: number) => left + ((i + 0.5) * (width - left - right)) / values.length;
    const y = (value: number) => height - bottom - ((height - top - bottom) * value) / end;
    const svg = drawing('svg', { viewBox: `0 0 ${width} ${height}`, role: 'img', class: 'plot' });
    for (let tick = 0; tick <= end + step / 2; tick += step) {
      svg.append(drawing('path', { class: 'grid', d: `M${left} ${y(tick)}H${width - right}` }));
      const label = drawing('text', { x: left - 8, y: y(tick) + 4, class: 'end' });
      label.textContent = fixed(tick, step < 0.01 ? 3 : 2);
      svg.append(label);
    }
    const every = Math.ceil(values.length / 6);
    values.forEach((value, i) => {
      svg.append(drawing('path', { class: 'whisker', d: `M${x(i)} ${y(value.epipolar_px - value.sigma_px)}V${y(value.epipolar_px + value.sigma_px)}` }));
      svg.append(drawing('circle', { class: 'dot', cx: x(i), cy: y(value.epipolar_px), r: 5 }));
      if (i % every !== 0) return;
      const label = drawing('text', { x: x(i), y: height - bottom + 18, class: 'middle' });
      label.textContent = value.station.length > 10 ? `${value.station.slice(0, 9)}\u2026` : value.station;
      svg.append(label);
    });
    const unit = drawing('text', { x: left, y: height - 4, class: 'unit' });
    unit.textContent = 'station; residual in px, bars are one sigma';
    svg.append(unit);
    const least = Math.min(...values.map((value) => value.epipolar_px));
    const most = Math.max(...values.map((value) => value.epipolar_px));
    const last = values[values.length - 1]!;
    const about = `${count(values.length, 'station', 'stations')}, ${fixed(least, 3)} to ${fixed(most, 3)} px; last ${fixed(last.epipolar_px, 3)} \u00b1 ${fixed(last.sigma_px, 3)} px at ${last.station}`;
    svg.setAttribute('aria-label', `Epipolar residual: ${about}`);
    byId('drift').replaceChildren(svg);
    say(words, about);
  }
}

function niceStep(rough: number): number {
  const power = 10 ** Math.floor(Math.log10(rough));
  return power * ([1, 2, 5, 10].find((factor) => factor * power >= rough) ?? 10);
}
