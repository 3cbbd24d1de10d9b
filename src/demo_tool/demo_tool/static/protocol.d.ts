// What the server and the page say to each other over the websocket. test_page_types.py holds it against the server.

/** Rows and columns of the colour picture [pixels]. */
export type Box = [top: number, left: number, bottom: number, right: number];
export type Pixel = [row: number, column: number];

export type State =
  | "waiting_for_camera" | "stale" | "ready" | "planning" | "executing" | "recording" | "proposing" | "failed" | "stopped"
  | "waiting_for_approval" | "recovering";
export type EndName = "pick" | "place";
export type Primitive = "pick_place" | "sweep" | "fold";
export type Source = "clicked" | "corrected" | "proposed" | "expert";

/** What a box holds: the points that stand out of the table, and their middle. */
export interface Grasp {
  centroid_base: [x: number, y: number, z: number];
  centroid_pixel: Pixel;
  cloud_pixels: Pixel[];
  points: number;
  footprint: Pixel[][];
  words: string;
}

/** A box and a rotation as the server judges them; directions: of each rotation in the picture, unit vectors or none. */
export interface DrawnEnd {
  box: Box;
  rotation: number;
  directions: Pixel[];
  footprint: Pixel[][];
  grasp: Grasp | null;
  words: string;
}

export interface Ends {
  pick: DrawnEnd | null;
  place: DrawnEnd | null;
}

export interface Draft extends Ends {
  source: Source;
}

export interface Plan {
  reachable: boolean;
  words: string;
}

/** The plan that waits for a person; asked: its approval is on its way; words: why the executor did not take one. */
export interface Approval {
  plan: string;
  asked: boolean;
  words: string;
}

export interface Step {
  step: number;
  instruction: string;
  primitive: Primitive;
  source: Source;
  outcome: string;
  message: string;
}

/** The episode that is recorded; restorable: whether the step that was undone last can be brought back. */
export interface OpenEpisode {
  name: string;
  steps: Step[];
  restorable: boolean;
}

export interface Proposal {
  instruction: string;
  confidence: number | null;
  pick_pixel: Pixel;
  pick_rotation: number;
  place_pixel: Pixel;
  place_rotation: number;
}

export interface PolicyView {
  state: string;
  words: string;
  proposal: Proposal | null;
}

/** What a lesson begins with; auto: the shipped policy that can act as demonstrated. */
export type Beginning = "auto" | "none";

/** What is learned of a data set; share: of the training's steps; table: what is compared, before and after. */
export interface Lesson {
  state: "none" | "running" | "stopped" | "failed" | "learned";
  data_set: string;
  words: string;
  share: number | null;
  table: [what: string, before: string, after: string][];
  policy: string | null;
}

/** Where the steps of finished episodes were: the middles of their boxes. */
export interface Covered {
  pick: Pixel[];
  place: Pixel[];
}

export interface Camera {
  width: number;
  height: number;
  age_ms: number | null;
  fps: number;
}

/** A calibration of the camera; share: of its samples that are taken. */
export interface Calibration {
  state: "none" | "running" | "stopped" | "failed" | "done";
  words: string;
  lines: string[];
  share: number;
}

/** Everything that the page shows. The first message has all of it, the later ones have what changed. */
export interface View {
  state: State;
  words: string;
  instruction: string;
  history: string[];
  primitive: Primitive;
  n_rotations: number;
  draft: Draft;
  plan: Plan | null;
  phase: string;
  progress: number;
  approval: Approval | null;
  /** Whether the arm was measured away from its ready pose while nobody else moves it. */
  away: boolean;
  /** How wide is what the hand still holds while the arm does nothing [m]. */
  held_width: number | null;
  /** Whether a simulator is there that can make another scene. */
  scenes: boolean;
  data_set: string | null;
  /** The finished episodes of the open data set. */
  recorded: number;
  covered: Covered;
  episode: OpenEpisode | null;
  verdict: boolean | null;
  /** How the step ended that moved the arm and could not be saved. */
  unsaved: string | null;
  data_sets: string[];
  policy: PolicyView;
  lesson: Lesson;
  calibration: Calibration;
  camera: Camera;
  last: { ok: boolean; words: string };
  holder: "me" | "other" | null;
  may_take_over: boolean;
  pages: number;
}

export interface EpisodeInfo {
  name: string;
  n_steps: number;
  instructions: string[];
  success: boolean | null;
  finished: boolean;
  bytes: number;
  complaints: string[];
}

/** A recorded step; frames: how many pictures of its motion there are, one every frame_ms. */
export interface RecordedStep extends Step {
  frames: number;
  frame_ms: number;
}

export interface Episode {
  name: string;
  success: boolean | null;
  complaints: string[];
  steps: RecordedStep[];
}

export type Counts = Record<string, number>;

/** The counts of a data set that the page shows. */
export interface Statistics {
  n_episodes: number;
  n_steps: number;
  n_executed: number;
  success: Counts;
  instructions: Counts;
  color_words: Counts;
  primitives: Counts;
  sources: Counts;
  biases: string[];
}

/** An end as the page shows it. */
export interface SeenEnd {
  box: Box;
  rotation: number;
}

/** What the page shows as drawn: a command that brings it is refused where the server has another draft. */
export interface SeenDraft {
  primitive: Primitive;
  pick: SeenEnd | null;
  place: SeenEnd | null;
}

/** The commands with their arguments. */
export interface Commands {
  instruction: { text: string };
  mark: { success: boolean | null; episode?: string };
  stop: {};
  approve: { plan: string };
  resume: {};
  open_data_set: { name: string };
  primitive: { name: Primitive };
  pick: { box: Box; rotation: number };
  place: { box: Box; rotation: number };
  point: { end: EndName; pixel: Pixel; rotation: number };
  clear: {};
  preview: { draft: SeenDraft };
  execute: { text: string; draft: SeenDraft };
  record: { text: string; draft: SeenDraft };
  recover: {};
  open_hand: {};
  undo: {};
  restore_step: {};
  save_again: {};
  drop_unsaved: {};
  end_episode: { success?: boolean | null };
  discard_episode: {};
  new_scene: {};
  /** minutes: for training; null: as long as it needs. */
  teach: { minutes: number | null, init: Beginning };
  stop_teaching: {};
  use_learned: {};
  calibrate: { board: string; move: boolean; first: string };
  stop_calibrating: {};
  propose: { text: string };
  correct: {};
  episodes: {};
  episode: { name: string };
  relabel: { name: string; text: string; step?: number };
  trim: { name: string; first: number | null; last: number | null };
  continue_episode: { name: string };
  delete: { name: string };
  restore: { name: string };
  trash: {};
  empty_trash: {};
  statistics: {};
  merge: { other: string };
  split: { parts: [name: string, share: number][]; seed?: number };
  take_over: {};
  give_up: {};
}

export type CommandName = keyof Commands;

/** Answers that carry more than words. */
export interface Answers {
  episodes: { episodes: EpisodeInfo[] };
  episode: Episode;
  trash: { trashed: string[]; undone_steps: number };
  statistics: { statistics: Statistics };
}

export type Answer<Name extends CommandName> = Name extends keyof Answers ? Answers[Name] : { ok?: boolean; words?: string } | null;

/** What a command takes: nothing where all of it may be left away. */
export type Given<Name extends CommandName> = {} extends Commands[Name] ? [args?: Commands[Name]] : [args: Commands[Name]];

/** Asks the station; rejects with an Error that has words for a person. */
export type Call = <Name extends CommandName>(command: Name, ...args: Given<Name>) => Promise<Answer<Name>>;

/** Asks the station and shows what it says; never rejects. */
export type Edit = <Name extends CommandName>(command: Name, ...args: Given<Name>) => Promise<void>;

export type Message =
  | { view: Partial<View> }
  | { id: number; ok: true; answer: unknown }
  | { id: number; ok: false; error: string };
