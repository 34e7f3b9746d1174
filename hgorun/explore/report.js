"use strict";
// Figures are made when they come into sight: dozens, behind tabs and below, would keep the page from being read.
{
  const dressed = scheme(() => window.Bokeh.documents.flatMap((document) => document.roots()));
  const name = (part) => label_parts(part, part.getAttribute("aria-label"));

  async function make(panel) {
    const written = panel.querySelector("script");
    if (written === null) return;
    written.remove();
    await Bokeh.embed.embed_item(JSON.parse(written.textContent), panel.id);
    dressed();
    named(panel.closest(".part"));
  }
  // Its parts come after it: until none has come for a second, and Bokeh has drawn what it has.
  function named(part, before = -1) {
    const found = name(part).length;
    const drawn = window.Bokeh.documents.every((document) => document.is_idle);
    if (found !== before || !drawn) setTimeout(() => named(part, found), 1000);
  }
  const near = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) if (isIntersecting) make(target);
  }, { rootMargin: "300px" });
  for (const panel of document.querySelectorAll(".panel")) near.observe(panel);  // one that is hidden is out of sight
  addEventListener("beforeprint", () => { for (const panel of document.querySelectorAll(".panel:not([hidden])")) make(panel); });

  for (const list of document.querySelectorAll(".tabs")) {
    const tabs = [...list.children];
    list.addEventListener("click", ({ target }) => {
      if (!tabs.includes(target)) return;
      for (const tab of tabs) {
        tab.setAttribute("aria-selected", String(tab === target));
        document.getElementById(tab.getAttribute("aria-controls")).hidden = tab !== target;
      }
    });
  }

  // Heads of columns are reached with Tab and answer to Enter and the space bar; they are drawn as one scrolls. What
  // scrolls in a table takes the focus, too: its rim is inside, since all else is cut off there.
  const tables = [...document.querySelectorAll(".part")].filter((part) => part.querySelector(".tabs") === null);
  function reach() {
    for (const one of tables.flatMap(name)) {
      if (one.dataset.reached || !one.matches(".bk-data-table, .slick-header-column")) continue;
      one.dataset.reached = "yes";
      if (one.matches(".bk-data-table")) {  // Tab would go from cell to cell, and keep a keyboard inside
        one.addEventListener("keydown", (event) => { if (event.key === "Tab") event.stopPropagation(); }, true);
        for (const sink of one.querySelectorAll("[hidefocus]")) sink.tabIndex = -1;  // which show no focus
        continue;
      }
      one.tabIndex = 0;
      one.setAttribute("role", "button");
      one.addEventListener("keydown", (event) => {
        if (event.key !== "Enter" && event.key !== " ") return;
        event.preventDefault();
        one.click();
        setTimeout(reach, 300);
      });
    }
  }
  setInterval(reach, 1000);
}
