// Of a logarithmic axis, `most` at most: every digit times powers of ten, or 1, 2 and 5 times, or only powers. Bokeh's own
// ticks are evenly spaced between two powers, often a single one.
const [low, high] = [cb_data.start, cb_data.end].sort((one, other) => one - other);
const first = Math.floor(Math.log10(low)), last = Math.floor(Math.log10(high));
const times = (digits, step = 1) => {
  const found = [];
  for (let power = step * Math.ceil(first / step); power <= last; power += step)
    for (const digit of digits) found.push(Number(`${digit}e${power}`));
  return found.filter((tick) => tick >= low && tick <= high);
};
const every = [1, 2, 3, 4, 5, 6, 7, 8, 9];
if (cb_data.major_ticks !== undefined) return last - first < most ? times(every) : [];  // the small ones
const fitting = [every, [1, 2, 5], [1]].map((digits) => times(digits)).find((found) => found.length <= most);
const ticks = fitting ?? times([1], Math.ceil((last - first + 1) / most));
if (ticks.length > 1) return ticks;
const step = 10 ** Math.floor(Math.log10((high - low) / 2));  // zoomed in: evenly
return Array.from({ length: Math.floor(high / step) - Math.ceil(low / step) + 1 }, (_, k) => step * (Math.ceil(low / step) + k))
  .filter((_, k, all) => k % Math.ceil(all.length / most) === 0);
