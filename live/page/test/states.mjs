// Scripted states of the contract: the three stages, what goes wrong, and what no one should ever send.

function histogram(dark, bright) {
  const raw = Array.from({ length: 64 }, (_, i) => Math.exp(-(((i - 36) / 7) ** 2)) + 0.35 * Math.exp(-(((i - 3) / 1.6) ** 2)) + 0.08 * Math.exp(-(((i - 55) / 2.2) ** 2)));
  raw[0] += dark;
  raw[63] += bright;
  const sum = raw.reduce((a, b) => a + b, 0);
  return raw.map((value) => value / sum);
}

export function camera(side, changes = {}) {
  return {
    side, name: side === 'left' ? 'Basler acA2440-20gm (40012345)' : 'Basler acA2440-20gm (40012346)', running: true, trouble: '', frames: 1234,
    dropped: 0, lost: 0, swapped: 0, incomplete: 0, rate_hz: 19.9, latency_ms: 43.2, exposure_s: 0.01, gain: 0, temperature_c: 41.2, warming: false,
    width_px: 1224, height_px: 1024, histogram: histogram(0.2, 0.03), saturated: 0.001, dark: 0.02, focus: 0.83, blur_px: 0.6, coded: 7, uncoded: 1,
    doubtful: 1, ...changes,
  };
}

const yes = { next: true, repeat: true, undo: true, finish: false, cancel: false, check: true };
const noReason = { next: '', repeat: '', undo: '', finish: '', cancel: 'nothing is running', check: '' };

function stages(current) {
  const list = [
    { name: 'calibrate', title: 'Calibrate the cameras', state: 'done', have: 25, want: 25, summary: 'baseline 800.012 \u00b1 0.008 mm', report: 'results/calibrate/report.html' },
    { name: 'commission', title: 'Commission the machine', state: 'done', have: 9, want: 9, summary: 'axis straight to 0.04 mm', report: 'results/commission/report.html' },
    { name: 'scan', title: 'Scan the segment', state: 'begun', have: 2, want: 5, summary: '', report: null },
  ];
  const at = list.findIndex((stage) => stage.name === current);
  return list.map((stage, i) => (i < at ? stage : { ...stage, state: i === at ? 'begun' : 'empty', have: i === at ? { calibrate: 12, commission: 2, scan: 2 }[stage.name] : 0, report: null, summary: '' }));
}

export function markers(ids, frame = true) {
  return ids.map((id, i) => ({
    id, state: i === 3 ? 'doubtful' : 'coded', left: true, right: i !== 5,
    xyz_mm: frame && i !== 5 ? [700 + 95.5 * i, 1204.31 + 3.2 * i, 310.12 - 41.7 * (i % 4)] : null,
    sigma_mm: frame && i !== 5 ? [0.021, 0.048, 0.019] : null, w: i === 5 ? null : i === 3 ? 4.2 : 0.6 + 0.1 * i,
  }));
}

export function stations(done, stage = 'scan') {
  return [650, 850, 1050, 1250, 1450].map((x, i) => ({
    name: `x${String(x).padStart(4, '0')}`, axis_mm: x, measured_mm: i < done ? x + 0.04 * (i - 1) : null, cross: stage === 'scan' || i < done ? 'taken' : 'missing',
    scan: stage !== 'scan' ? 'none' : i < done ? 'done' : 'missing', epipolar_px: stage === 'scan' || i < done ? 0.031 + 0.003 * i : null, current: i === done,
  }));
}

const log = [
  { time: '11:18:02', level: 'info', text: 'Job door frame, segment 3 opened.' },
  { time: '11:18:40', level: 'warning', text: 'Left camera: 2 frames lost.' },
  { time: '11:20:03', level: 'info', text: 'Station x0850 taken: 5 markers, epipolar residual 0.031 px.' },
];

export function base(changes = {}) {
  const stage = changes.stage ?? 'commission';
  return {
    format: 'crosstie-live/1', sequence: 41, time: '2026-11-28T11:20:03Z', job: { name: 'door frame, segment 3', folder: 'segment' }, stage, stages: stages(stage),
    instruction: 'Move the beam to X = 1050 mm and press Next.', can: { ...yes }, why_not: { ...noReason },
    cameras: [camera('left'), camera('right', { frames: 1233, temperature_c: 40.8, latency_ms: 44.9, focus: 0.79, uncoded: 2, doubtful: 0 })],
    pairs: { count: 1230, unmatched: 1, contradicted: 0 }, markers: markers([3, 12, 17, 21, 24, 30, 44]), frame: 'machine', needed: { want: 5, seen: 5, missing: [] },
    axis: { source: 'typed in', typed: true, position_mm: 850.04, age_s: 2.1, fresh: true, trouble: '' }, board: null, stations: stations(2, stage), work: null,
    health: { level: 'OK', text: 'head unchanged: 0.9 of 3.76 (2 h ago)' },
    drift: [{ station: 'x0650', epipolar_px: 0.029, sigma_px: 0.002 }, { station: 'x0850', epipolar_px: 0.031, sigma_px: 0.002 }],
    gaps: null, verdicts: [], scene_version: 7, log: [...log], ...changes,
  };
}

const board = {
  columns: 8, rows: 6, left: Array.from({ length: 48 }, (_, i) => (i % 8 > 5 && i < 24 ? 0 : (i * 7) % 5)), right: Array.from({ length: 48 }, (_, i) => (i % 8 < 2 && i > 24 ? 0 : (i * 5) % 4)),
  poses: 12, tilts: { left: 2, right: 1, up: 0, down: 3, rolled: 1 }, wanted: 'Tilt the board to the left, in the upper right corner of the image.', cell: [7, 0], cell_side: 'right',
};

const resultVerdicts = [
  { name: 'seam_mm', value: 0.02, limit: 0.1, unit: 'mm', level: 'OK', source: 'job.toml, [limits]' },
  { name: 'edge_sigma_mm', value: 0.11, limit: 0.1, unit: 'mm', level: 'WARNING', source: 'accuracy asked for: 0.3 mm, a third of it' },
  { name: 'coverage', value: 0.96, limit: 0.99, unit: '', level: 'FAIL', source: 'job.toml, [limits]' },
];

export const hostile = '<img src=x onerror="window.hacked=1"><script>window.hacked=1</script>';
const long = 'Donaudampfschifffahrtsgesellschaftskapitaensmuetzenhalterung '.repeat(4).trim();

/** The names are those of the tests and of the pictures that they save. */
export const states = {
  'calibrate-begin': base({
    stage: 'calibrate', instruction: 'Hold the board so that both cameras see it, and press Next.', frame: null, markers: [], needed: null, drift: [], stations: [],
    board: { ...board, left: Array(48).fill(0), right: Array(48).fill(0), poses: 0, tilts: { left: 0, right: 0, up: 0, down: 0, rolled: 0 }, wanted: 'Hold the board in the middle of the image, upright.', cell: [3, 2], cell_side: 'left' },
    can: { ...yes, next: false, repeat: false, undo: false, check: false },
    why_not: { ...noReason, next: 'the board is not seen by both cameras', repeat: 'nothing was taken yet', undo: 'nothing was taken yet', finish: '25 poses are needed, 0 are taken', check: 'the cameras are not calibrated' },
    health: { level: 'NONE', text: '' }, log: [], axis: { source: 'typed in', typed: true, position_mm: null, age_s: null, fresh: false, trouble: '' },
    cameras: [camera('left', { warming: true, temperature_c: 33.1, coded: 0, uncoded: 0, doubtful: 0 }), camera('right', { warming: true, temperature_c: null, coded: 0, uncoded: 0, doubtful: 0 })],
  }),
  calibrate: base({
    stage: 'calibrate', instruction: 'Tilt the board to the left, in the upper right corner of the image, and press Next.', frame: null, needed: null, drift: [], board, stations: [],
    why_not: { ...noReason, finish: '25 poses are needed, 12 are taken', check: 'the cameras are not calibrated' }, can: { ...yes, check: false },
    health: { level: 'NONE', text: 'the cameras are not calibrated yet' }, markers: markers([3, 12, 17], false),
  }),
  commission: base({ stage: 'commission', why_not: { ...noReason, finish: '9 stations are needed, 2 are taken' } }),
  'commission-missing': base({
    stage: 'commission', instruction: 'The cross must show 5 markers: marker 17 is not seen. Move the beam or clear the view.', needed: { want: 5, seen: 4, missing: [17] },
    can: { ...yes, next: false }, why_not: { ...noReason, next: 'marker 17 is not seen', finish: '9 stations are needed, 2 are taken' },
    axis: { source: 'typed in', typed: true, position_mm: 850.04, age_s: 95, fresh: false, trouble: '' }, health: { level: 'WARNING', text: 'head moved a little: 3.1 of 3.76 (5 min ago)' },
  }),
  scan: base({ stage: 'scan', instruction: 'Move the beam to X = 1050 mm and press Next.', why_not: { ...noReason, finish: '3 stations are missing' }, gaps: { count: 1, length_mm: 83, coverage: 0.96 }, scene_version: 9 }),
  'scan-working': base({
    stage: 'scan', instruction: 'The segment is being scanned. Do not move the beam.', work: { what: 'scan x1050', stage: 'decoding', done: 3, total: 18, seconds: 4.2 },
    can: { next: false, repeat: false, undo: false, finish: false, cancel: true, check: false },
    why_not: { next: 'a scan is running', repeat: 'a scan is running', undo: 'a scan is running', finish: 'a scan is running', cancel: '', check: 'a scan is running' }, gaps: { count: 1, length_mm: 83, coverage: 0.96 }, scene_version: 9,
  }),
  'scan-done': base({
    stage: 'scan', instruction: 'All stations are scanned. Press Finish stage.', stations: stations(5), can: { ...yes, next: false, finish: true }, why_not: { ...noReason, next: 'all stations are scanned' },
    stages: stages('scan').map((stage) => (stage.name === 'scan' ? { ...stage, state: 'ready', have: 5, report: 'results/scan/report.html' } : stage)), verdicts: resultVerdicts, gaps: { count: 0, length_mm: 0, coverage: 1 },
    drift: [650, 850, 1050, 1250, 1450].map((x, i) => ({ station: `x${String(x).padStart(4, '0')}`, epipolar_px: 0.029 + 0.004 * i, sigma_px: 0.002 })), scene_version: 9,
    axis: { source: 'LinuxCNC', typed: false, position_mm: 1450.02, age_s: 0.3, fresh: true, trouble: '' },
  }),
  'camera-lost': base({
    stage: 'scan', instruction: 'The right camera does not answer: check its cable, then press Connect the cameras again.', can: { ...yes, next: false, repeat: false, check: false },
    why_not: { ...noReason, next: 'the right camera does not run', repeat: 'the right camera does not run', check: 'the right camera does not run', finish: '3 stations are missing' },
    cameras: [camera('left', { lost: 3, saturated: 0.043 }), camera('right', { running: false, trouble: 'no frame for 3 s: is the cable in?', rate_hz: 0, latency_ms: null, temperature_c: null, focus: null, blur_px: null, saturated: null, dark: null, histogram: Array(64).fill(0), coded: 0, uncoded: 0, doubtful: 0, incomplete: 4 })],
    axis: { source: 'LinuxCNC', typed: false, position_mm: null, age_s: null, fresh: false, trouble: 'LinuxCNC does not answer on port 5007' }, health: { level: 'FAIL', text: 'head moved: 9.4 of 3.76; commission it anew' },
    pairs: { count: 1230, unmatched: 41, contradicted: 2 }, needed: { want: 5, seen: 2, missing: [12, 17, 44] }, markers: markers([3, 21]), log: [...log, { time: '11:24:51', level: 'error', text: 'Right camera: no frame for 3 s.' }],
  }),
  'long-texts': base({
    stage: 'scan', instruction: `${long}. Move the beam slowly and look whether all of the markers are seen by both of the cameras before you press Next.`, job: { name: long, folder: '/very/long/folder/'.repeat(9) },
    why_not: { ...noReason, next: long, undo: 'the last station was taken by another program and cannot be removed here', finish: '3 stations are missing', cancel: '' }, can: { ...yes, next: false, undo: false },
    stages: stages('scan').map((stage) => ({ ...stage, title: `${stage.title} with a very long title indeed`, have: 12345, want: 99999 })),
    cameras: [camera('left', { name: long, trouble: long, frames: 123456789, dropped: 123456, lost: 99999, swapped: 1234, incomplete: 4567, coded: 123, uncoded: 456, doubtful: 789 }), camera('right')],
    needed: { want: 54, seen: 2, missing: Array.from({ length: 52 }, (_, i) => i + 1) }, health: { level: 'FAIL', text: long }, axis: { source: long, typed: true, position_mm: -123456.78, age_s: 9999, fresh: false, trouble: long },
    stations: Array.from({ length: 40 }, (_, i) => ({ ...stations(2)[0], name: i === 5 ? long : `station-number-${i}`, current: i === 20 })), markers: markers(Array.from({ length: 54 }, (_, i) => 2 * i + 1)),
    verdicts: [{ name: long, value: 123456.789, limit: 0.00001234, unit: 'mm', level: 'FAIL', source: long }, ...resultVerdicts], drift: Array.from({ length: 40 }, (_, i) => ({ station: `station-number-${i}`, epipolar_px: 0.03 + 0.01 * (i % 3), sigma_px: 0.004 })),
    log: Array.from({ length: 100 }, (_, i) => ({ time: '11:20:03', level: ['info', 'warning', 'error'][i % 3], text: `${i}: ${long}` })), work: { what: long, stage: long, done: 12345, total: 99999, seconds: 86400 }, gaps: { count: 12, length_mm: 12345.6, coverage: 0.1 }, scene_version: 9,
  }),
  hostile: base({
    stage: 'calibrate', instruction: hostile, job: { name: hostile, folder: hostile }, why_not: { next: hostile, repeat: hostile, undo: hostile, finish: hostile, cancel: hostile, check: hostile }, can: { next: false, repeat: false, undo: false, finish: false, cancel: false, check: false },
    stages: stages('scan').map((stage, i) => ({ ...stage, title: hostile, summary: hostile, report: ['javascript:window.hacked=1', '//evil.example/results/report.html', 'results/../../secret.html'][i] })),
    cameras: [camera('left', { name: hostile, trouble: hostile }), camera('right', { name: hostile })], axis: { source: hostile, typed: true, position_mm: 1, age_s: 1, fresh: true, trouble: hostile },
    board: { ...board, wanted: hostile, tilts: { [hostile]: 1 } }, stations: [{ ...stations(2)[2], name: hostile }], work: { what: hostile, stage: hostile, done: 1, total: 2, seconds: 1 }, health: { level: 'FAIL', text: hostile },
    drift: [{ station: hostile, epipolar_px: 0.03, sigma_px: 0.002 }], verdicts: [{ name: hostile, value: 1, limit: 2, unit: hostile, level: 'OK', source: hostile }], log: [{ time: hostile, level: 'error', text: hostile }], scene_version: 11,
  }),
};

/** The scene of a version: 7 markers only, 9 with patches and a gap, 11 hostile. */
export function scene(version) {
  const radius = 3000;
  const onWall = (x, angle) => [x, radius * (1 - Math.cos(angle)) + 1200, radius * Math.sin(angle)];
  const around = (t) => onWall(1050 + 420 * Math.cos(t), 0.105 * Math.sin(t));
  const known = [3, 12, 17, 21, 24, 30, 44, 51, 58, 63, 70, 77].map((id, i) => ({ id, xyz_mm: onWall(560 + 90 * i, i % 2 ? 0.15 : -0.15), sigma_mm: 0.02 + 0.004 * i, live: i < 6 }));
  const plain = { version, frame: 'machine', unit: 'mm', markers: known, patches: [], rim: [], head: { position_mm: [850, -100, 0], axes: [1, 0, 0, 0, 0, 1, 0, -1, 0] } };
  if (version === 11) return { ...plain, markers: [{ ...known[0], id: hostile }], patches: [{ station: hostile, colour: -3, points: 'AAAA' }] };
  if (version !== 9) return plain;
  const arc = (from, to, gap) => ({ gap, xyz_mm: Array.from({ length: 60 }, (_, i) => around(from + ((to - from) * i) / 59)) });
  const patch = (station, colour, from, to) => {
    const points = [];
    for (let t = from; t < to; t += 0.012) {
      for (let s = 1.04; s < 1.34; s += 0.02) points.push(...onWall(1050 + 420 * s * Math.cos(t), 0.105 * s * Math.sin(t)));
    }
    return { station, colour, points: Buffer.from(new Float32Array(points).buffer).toString('base64') };
  };
  return {
    ...plain,
    patches: [patch('x0650', 0, 1.9, 4.6), patch('x0850', 1, 0.7, 2.2), patch('x1050', 2, 4.3, 5.9)],
    rim: [arc(0.7, 5.9, false), arc(5.9, 6.98, true)],
  };
}
