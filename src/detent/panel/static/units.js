// What is shown of SI values, and what is typed: inside the axis everything is SI, on the screen mm and degrees.

const SHOWN = {
  m: ["mm", 1e3, 3], "m/s": ["mm/s", 1e3, 2], "m/s^2": ["m/s^2", 1, 3],
  rad: ["deg", 180 / Math.PI, 3], "rad/s": ["deg/s", 180 / Math.PI, 2], "rad/s^2": ["deg/s^2", 180 / Math.PI, 1],
  s: ["ms", 1e3, 3], 1: ["%", 100, 1], "%": ["%", 100, 1],
};
const NUMBER = /^[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?$/i;

/** Unit on the screen, factor and digits of a unit of the axis. */
export function shown(unit) {
  const [name, factor, digits] = SHOWN[unit] ?? [unit ?? "", 1, 4];
  return { name, factor, digits };
}

/** A value as text, without its unit. */
export function number(value, unit) {
  const { factor, digits } = shown(unit);
  if (value === null || value === undefined || !Number.isFinite(value)) return "–";
  const text = (value * factor).toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text;
}

/** A value with its unit. */
export function quantity(value, unit) {
  return `${number(value, unit)} ${shown(unit).name}`.trim();
}

/** A duration in a unit that suits it. */
export function duration(seconds) {
  if (!Number.isFinite(seconds)) return "–";
  const size = Math.abs(seconds);
  if (size < 1e-3) return `${(seconds * 1e6).toFixed(0)} us`;
  return size < 1 ? `${(seconds * 1e3).toFixed(size < 0.01 ? 2 : 0)} ms` : `${seconds.toFixed(2)} s`;
}

/** What was typed, with a unit: a bare number is in the unit that stands beside the field. */
export function typed(text, unit) {
  const trimmed = text.trim().replace(",", ".");
  return NUMBER.test(trimmed) ? `${trimmed} ${shown(unit).name}`.trim() : trimmed;
}
