// Registers of a method, as they are now: for its view.

/** Call `told({name: value, ...})` once a frame with the newest row of some channels; gives what ends it. */
export function follow(link, names, told) {
  let frame = 0;
  const values = {};
  const look = () => {
    frame = 0;
    told(values);
  };
  const onRows = () => {
    const { count, channels, columns } = link.rows;
    channels.forEach((name, k) => { values[name] = columns[(k + 1) * count - 1]; });
    frame ||= requestAnimationFrame(look);
  };
  link.addEventListener("rows", onRows);
  link.watch(names).catch((error) => told({ error: error.message }));
  return () => {
    link.removeEventListener("rows", onRows);
    link.watch([]).catch(() => {});
    cancelAnimationFrame(frame);
  };
}
