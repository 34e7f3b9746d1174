"use strict";
// What of Bokeh's figures takes the focus: its role, its name, and a rim that shows the focus. Bokeh's parts stand in
// roots of their own, and are built after the document.
const label_parts = (() => {
  const rim = new CSSStyleSheet();
  rim.replaceSync(`:host { --icon-color: var(--soft, #4a4a4a); --active-border: var(--accent, #00517f); }
    :host(:focus-visible), :focus-visible { outline: 3px solid var(--accent, #00517f) !important; outline-offset: -3px; }
    .slick-row, .slick-row.odd, .slick-header-column { background: var(--ground) !important; color: var(--ink) !important; }
    .slick-row.odd { background: var(--stripe) !important; } .slick-cell { border-color: var(--row) !important; }`);
  const inside = (root) => [...root.querySelectorAll("*")].flatMap((one) => one.shadowRoot ? [one, ...inside(one.shadowRoot)] : [one]);
  function label_tool(one, whose) {
    if (one.getAttribute("role") === "button") return;
    one.setAttribute("role", "button");
    one.setAttribute("aria-label", `${one.title.split("\n")[0]}: ${whose}`);
    one.addEventListener("keydown", (event) => {  // a button answers to the space bar, too
      if (event.key !== " ") return;
      event.preventDefault();
      event.stopImmediatePropagation();
      one.dispatchEvent(new KeyboardEvent("keydown", { key: "Enter" }));
    }, true);
    if (!one.matches(".bk-OnOffButton")) return;
    const pressed = () => one.setAttribute("aria-pressed", String(one.classList.contains("bk-active")));
    new MutationObserver(pressed).observe(one, { attributes: true, attributeFilter: ["class"] });
    pressed();
  }
  return (root, whose) => {
    const found = inside(root);
    for (const one of found) {
      if (one.shadowRoot && !one.shadowRoot.adoptedStyleSheets.includes(rim)) one.shadowRoot.adoptedStyleSheets.push(rim);
      if (one.matches(".bk-events")) { one.setAttribute("role", "img"); one.setAttribute("aria-label", whose); }
      if (one.matches(".bk-OnOffButton, .bk-ClickButton")) label_tool(one, whose);
    }
    return found;
  };
})();
