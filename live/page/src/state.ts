// The state as the program sends it. null: unknown. Lengths in mm, times in s, image lengths in px.

export type Triple = [number, number, number];
export type StageName = 'calibrate' | 'commission' | 'scan';
export type Level = 'OK' | 'WARNING' | 'FAIL' | 'NONE';
export type Deed = 'next' | 'repeat' | 'undo' | 'finish' | 'cancel' | 'check';

export interface Stage {
  name: StageName;
  title: string;
  state: 'empty' | 'begun' | 'ready' | 'done';
  have: number;
  want: number;
  summary: string;
  report: string | null;
}

export interface Camera {
  side: 'left' | 'right';
  name: string;
  running: boolean;
  trouble: string;
  frames: number;
  dropped: number;
  lost: number;
  swapped: number;
  incomplete: number;
  rate_hz: number | null;
  latency_ms: number | null;
  exposure_s: number | null;
  gain: number | null;
  temperature_c: number | null;
  warming: boolean;
  width_px: number | null;
  height_px: number | null;
  histogram: number[];
  saturated: number | null;
  dark: number | null;
  focus: number | null;
  blur_px: number | null;
  coded: number;
  uncoded: number;
  doubtful: number;
}

export interface Marker {
  id: number;
  state: 'coded' | 'doubtful';
  left: boolean;
  right: boolean;
  xyz_mm: Triple | null;
  sigma_mm: Triple | null;
  w: number | null;
}

export interface Axis {
  source: string;
  typed: boolean;
  position_mm: number | null;
  age_s: number | null;
  fresh: boolean;
  trouble: string;
}

export interface Board {
  columns: number;
  rows: number;
  left: number[];
  right: number[];
  poses: number;
  tilts: Record<string, number>;
  wanted: string;
  cell: [number, number] | null;
  cell_side: Camera['side'];
}

export interface Station {
  name: string;
  axis_mm: number;
  measured_mm: number | null;
  cross: 'none' | 'missing' | 'taken';
  scan: 'none' | 'missing' | 'taken' | 'done';
  epipolar_px: number | null;
  current: boolean;
}

export interface Verdict {
  name: string;
  value: number | null;
  limit: number | null;
  unit: string;
  level: Level;
  source: string;
}

export interface LogLine {
  time: string;
  level: 'info' | 'warning' | 'error';
  text: string;
}

export interface State {
  format: string;
  sequence: number;
  time: string;
  job: { name: string; folder: string };
  stage: StageName;
  stages: Stage[];
  instruction: string;
  can: Record<Deed, boolean>;
  why_not: Record<Deed, string>;
  cameras: Camera[];
  pairs: { count: number; unmatched: number; contradicted: number };
  markers: Marker[];
  frame: 'machine' | 'rig' | null;
  needed: { want: number; seen: number; missing: number[] } | null;
  axis: Axis;
  board: Board | null;
  stations: Station[];
  work: { what: string; stage: string; done: number; total: number; seconds: number } | null;
  health: { level: Level; text: string };
  drift: { station: string; epipolar_px: number; sigma_px: number }[];
  gaps: { count: number; length_mm: number; coverage: number } | null;
  verdicts: Verdict[];
  scene_version: number;
  log: LogLine[];
}

export interface Space {
  version: number;
  frame: string;
  unit: string;
  markers: { id: number; xyz_mm: Triple; sigma_mm: number | null; live: boolean }[];
  patches: { station: string; colour: number; points: string }[];
  rim: { xyz_mm: Triple[]; gap: boolean }[];
  head: { position_mm: Triple; axes: number[] } | null;
}
