"use strict";
// A page is dark where the browser is asked for that, and its figures then have the colours that hgorun.figures.page
// gives those for a dark page.
const scheme = (() => {
  const PAPER = [0x16, 0x18, 0x1d].map((part) => part / 255), INK = [0.949, 0.949, 0.949], GREY = 0.08;
  const asked = matchMedia("(prefers-color-scheme: dark)");
  const pen = document.createElement("canvas").getContext("2d");
  const first = new WeakMap();  // colours of models as they were written
  function dark(colour) {
    pen.fillStyle = colour;
    if (!/^#[0-9a-f]{6}$/.test(pen.fillStyle)) return colour;
    let parts = [1, 3, 5].map((i) => parseInt(pen.fillStyle.slice(i, i + 2), 16) / 255);
    if (Math.max(...parts) - Math.min(...parts) <= GREY) {
      const grey = (parts[0] + parts[1] + parts[2]) / 3;
      parts = INK.map((ink, i) => ink + (PAPER[i] - ink) * grey);
    } else {
      const light = 0.2126 * parts[0] ** 2.2 + 0.7152 * parts[1] ** 2.2 + 0.0722 * parts[2] ** 2.2;
      const white = Math.max(0, (0.3 - light) / (1 - light));
      parts = parts.map((part) => (part ** 2.2 * (1 - white) + white) ** (1 / 2.2));
    }
    return "#" + parts.map((part) => Math.round(255 * part).toString(16).padStart(2, "0")).join("");
  }
  function dress(model) {
    if (!first.has(model)) {
      const names = Object.keys(model.properties).filter((name) => name.endsWith("_color") && !model.properties[name].is_unset);
      first.set(model, Object.fromEntries(names.map((name) => [name, model[name]])));
    }
    const worn = {};
    for (const [name, spec] of Object.entries(first.get(model))) {
      const colour = spec?.value ?? spec;
      if (typeof colour !== "string") continue;
      const own = asked.matches ? dark(colour) : colour;
      worn[name] = spec.value === undefined ? own : { value: own };
    }
    model.setv(worn, { sync: false });
  }
  // Has models, and all that they refer to, given the colours of the page whenever these change, and when it is asked to.
  return (models) => {
    const all = () => { for (const root of models()) for (const model of root.references()) dress(model); };
    asked.addEventListener("change", all);
    return () => { if (asked.matches) all(); };
  };
})();
