// The scene as the report writes it: JSON in a script element. Lengths in mm, in the frame that the report names.

export type Triple = [number, number, number];

export interface ScenePoint {
  id: string;
  p: Triple;
  /** Semi-axes of the error ellipsoid (one sigma): three vectors, one after the other. */
  axes: number[];
  /** What colours the point, in the legend's unit. */
  value: number;
  /** Lines of text shown when the point is selected. */
  about: string[];
  /** Indices of the cameras that saw it. */
  seen: number[];
  /** A target without a code: drawn as a ring. */
  ring?: boolean;
  /** Deviation vector, in a verification. */
  d?: Triple;
}

export interface SceneCamera {
  name: string;
  /** Projection centre and the four corners of the image plane at a depth of 1: directions, row by row. */
  centre: Triple;
  corners: [Triple, Triple, Triple, Triple];
  /** Group for the colour: index of its camera. */
  group: number;
}

export interface SceneBar {
  a: Triple;
  b: Triple;
  name: string;
}

/** Many points without names. */
export interface SceneCloud {
  /** Taken off the coordinates, which are single precision. */
  centre: Triple;
  /** Base64 of little-endian single-precision numbers: x, y, z less the centre [mm], value and sigma of each point; not finite: none. */
  data: string;
  /** What the value is, in words, and its unit; what is said of a point without one. Empty: the value is the sigma. */
  value: string;
  unit: string;
  none: string;
  /** What the sigma is. */
  sigma: string;
  sigma_unit: string;
}

export interface Scene {
  points: ScenePoint[];
  cloud?: SceneCloud;
  /** What the points drawn as rings are. */
  rings?: string;
  cameras: SceneCamera[];
  bars: SceneBar[];
  /** `open`: values beyond max have its colour too. */
  legend: { label: string; min: number; max: number; open: boolean };
  /** Magnification to begin with, of ellipsoids and arrows. */
  magnification: number;
  /** Which way is up in the first view, and from where it looks. */
  up: Triple;
  towards: Triple;
}
