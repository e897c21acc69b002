/** What the JSON of the wasm package says. */

export type StopProgress =
  "not_asked" | "owed" | "confirmed" | "standing_still" | "still_moving" | "no_reports";

export interface BusNode {
  id: number;
  mode: "velocity" | "position" | null;
  health: "online" | "suspect" | "abnormal" | "unknown";
  velocity: number | null;
  position: number | null;
  age_ms: number | null;
  target: number | null;
  stop: StopProgress;
  timeouts: number;
  replies: number;
}

export interface BusState {
  discovering: boolean;
  nodes: BusNode[];
  statistics: Record<string, number>;
}

export type Fields = Record<string, unknown>;

export interface RoverState {
  link: "waiting" | "up" | "down";
  stop: StopProgress;
  /** How far the stop has come, in words. */
  stop_text: string;
  report: Fields | null;
  age_ms: number | null;
  round_trip_ms: number | null;
  command: { speed: number; angular: number; lamp: boolean } | null;
  statistics: Record<string, number>;
}

export interface RoleEvent {
  t: number;
  event: string;
  node?: number;
  text: string;
}

export interface Summary {
  /** Why a capture could not be read to its end. */
  cut: string | null;
  /** What else is to be told, such as impossible times. */
  notes: string[];
  has_times: boolean;
  summary: {
    received: number;
    framed: number;
    skipped: number;
    pending: number;
    frames: number;
    skipped_by: Record<string, number>;
    times_back?: number;
  };
}

/** How much of some bytes belongs to frames of a protocol. */
export interface Guess {
  protocol: string;
  framed: number;
  frames: number;
}

export interface Column {
  name: string;
  unit: string;
  meaning: string;
  numeric: boolean;
}

export interface Table {
  table: string;
  rows: number;
  columns: Column[];
}

/** What a simulated line has and a real one has not. */
export interface Simulation {
  truth: () => Truth;
  unplug: (node: number, isUnplugged: boolean) => void;
}

export interface Truth {
  nodes?: { id: number; rps: number; turns: number; unplugged: boolean }[];
  rover?: { rpm: number[]; heading: number };
}

/** How far the stop of a motor has come, in words. */
export const STOP_WORDS: Record<StopProgress, string> = {
  not_asked: "not asked",
  owed: "sent, no answer yet: may be moving",
  confirmed: "confirmed, not yet at standstill",
  standing_still: "stopped, seen at standstill",
  still_moving: "confirmed, but STILL MOVING",
  no_reports: "sent, but nothing is reported: may be moving",
};

/** A stop was asked for and the motor was not yet seen at standstill. */
export const isPending = (stop: StopProgress): boolean =>
  stop !== "not_asked" && stop !== "standing_still";
