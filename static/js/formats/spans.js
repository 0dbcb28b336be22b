/** Lengths of time as figures. Pure. */

/** Return seconds as "1:02:03.4"; without `tenths` as "1:02:03". */
export function spanText(seconds, tenths = false) {
  const all = tenths ? Math.round(seconds * 10) : Math.round(seconds) * 10;
  const [hours, minutes, rest] = [Math.floor(all / 36_000), Math.floor(all / 600) % 60, all % 600];
  const small = String(Math.floor(rest / 10)).padStart(2, "0") + (tenths ? `.${rest % 10}` : "");
  return hours ? `${hours}:${String(minutes).padStart(2, "0")}:${small}` : `${minutes}:${small}`;
}
