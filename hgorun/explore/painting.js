"use strict";
// How curves come to be seen. Bokeh computes anew, at every frame, what stays as it is on this page, and keeps five
// copies of every curve for tools that are not here. Where its inside is not what is replaced here, figures are as
// right and slower.
const painting = (() => {
  const here = { sync: false };  // the server knows it
  const silently = { silent: true };  // without Bokeh's search for models among the points
  const painted = new WeakMap(); // what was painted of a curve last: its points, their axes, its path
  let quick = false;
  const known = new WeakSet();   // elements of figures that are watched
  const away = new Set();        // those that are out of sight
  const behind = new Set();      // views of figures that are, and show what was before
  let later = 0;

  function quicken() {
    const part = (name) => Bokeh.require(name);
    const { VisualProperties } = part("core/visuals/visual"), { InlineStyleSheet } = part("core/dom");
    const { PlotView } = part("models/plots/plot_canvas"), { AxisView } = part("models/axes/axis");
    const { GlyphRendererView } = part("models/renderers/glyph_renderer");
    VisualProperties.prototype._get_css_value = () => "";  // no style of this page is for lines
    const size = Object.getOwnPropertyDescriptor(PlotView.prototype, "base_font_size").get;
    const kept = new WeakMap();
    const get = function () {
      if (!kept.get(this)) kept.set(this, size.call(this));
      return kept.get(this);
    };
    Object.defineProperty(PlotView.prototype, "base_font_size", { get, configurable: true });
    // style sheets of where the parts of a figure are: each that is written makes all styles of the page stale
    const write = InlineStyleSheet.prototype._update;
    InlineStyleSheet.prototype._update = function (css) { if (this.css !== css) write.call(this, css); };
    // the room that an axis takes follows from its ends; a digit more in its labels does not move everything
    const room = AxisView.prototype.get_size, rooms = new WeakMap();
    AxisView.prototype.get_size = function () {
      const [{ start, end }] = this.ranges, { width, height } = this.plot_view.frame.bbox;
      const key = `${start} ${end} ${width} ${height}`;
      let found = rooms.get(this);
      if (found?.key !== key) {
        const needed = room.call(this);
        rooms.set(this, found = { key, width: needed.width, height: 16 * Math.ceil(needed.height / 16) });
      }
      return { width: found.width, height: found.height };
    };
    const { TextAnnotationView } = part("models/annotations/text_annotation");
    const measure = TextAnnotationView.prototype.compute_geometry;  // of titles, also where there is none
    TextAnnotationView.prototype.compute_geometry = function () { if (this.displayed) measure.call(this); };
    GlyphRendererView.prototype.update_position = () => {};  // of a curve there is nothing in the document
    GlyphRendererView.prototype.update_data = async function () { this.request_paint(); };
    GlyphRendererView.prototype._paint = function (ctx) { paint(ctx, this); };
    quick = true;
  }

  function ends_of(scale) {
    const { start, end } = scale.source_range;
    return [start, end, scale.compute(start), scale.compute(end)];
  }
  function places(scale, [start, end, first, last], values) {
    const found = new Float64Array(values.length);
    const logarithmic = scale.type === "LogScale", from = logarithmic ? Math.log(start) : start;
    const unit = (last - first) / ((logarithmic ? Math.log(end) : end) - from);
    for (let i = 0; i < found.length; ++i)
      found[i] = first + unit * ((logarithmic ? Math.log(values[i]) : values[i]) - from);
    return found;
  }

  const own = (spec) => spec?.value ?? spec;  // of what a model has for all its points

  function paint(ctx, view) {
    const { glyph } = view.model, path = path_of(view);
    if (glyph.type === "Line") {
      ctx.strokeStyle = own(glyph.line_color);
      ctx.lineWidth = own(glyph.line_width);
      ctx.lineJoin = own(glyph.line_join);
      ctx.setLineDash(Array.isArray(own(glyph.line_dash)) ? own(glyph.line_dash) : []);
      ctx.stroke(path);
    } else {
      ctx.fillStyle = own(glyph.fill_color);
      ctx.fill(path);
    }
  }

  // A figure is painted as a whole: most of its curves, and often its axes, are as they were.
  function path_of(view) {
    const { data_source: { data }, glyph } = view.model, { x_scale, y_scale } = view.coordinates;
    const across = ends_of(x_scale), up = ends_of(y_scale), key = `${across} ${up}`;
    const [t, v] = ["t", "v"].map((name) => data instanceof Map ? data.get(name) : data[name]);
    const known = painted.get(view);
    if (known?.t === t && known.v === v && known.key === key) return known.path;
    const x = places(x_scale, across, t), y = places(y_scale, up, v);
    const path = glyph.type === "Line" ? line(x, y) : dots(x, y, own(glyph.size) / 2 + 0.5, own(glyph.marker) === "diamond");
    painted.set(view, { t, v, key, path });
    return path;
  }
  function line(x, y) {
    const path = new Path2D();
    let joined = false;
    for (let i = 0; i < x.length; ++i) {
      if (!Number.isFinite(x[i] + y[i])) joined = false;
      else if (joined) path.lineTo(x[i], y[i]);
      else { path.moveTo(x[i], y[i]); joined = true; }
    }
    return path;
  }
  function dots(x, y, r, square) {
    const path = new Path2D();
    for (let i = 0; i < x.length; ++i) {
      if (!Number.isFinite(x[i] + y[i])) continue;
      path.moveTo(x[i] + r, y[i]);
      if (!square) path.arc(x[i], y[i], r, 0, 2 * Math.PI);
      else { path.lineTo(x[i], y[i] + r); path.lineTo(x[i] - r, y[i]); path.lineTo(x[i], y[i] - r); }
    }
    return path;
  }

  // Bokeh would draw each figure in the next frame; here all have been drawn when this returns, but for those out of sight.
  function draw(document, { curves, limits, dashes }, points) {
    const model = (id) => document.get_model_by_id(id), views = figures();
    let first = 0;
    const next = (count) => points.subarray(first, first += count);
    for (const view of views) view.pause();
    for (const [id, count] of Object.entries(curves))
      model(id).setv({ data: { t: next(count), v: next(count) } }, quick ? silently : here);
    if (quick) for (const view of views) for (const [one, own_view] of view.renderer_views)
      if (one.data_source?.id in curves) view.invalidate_painters(own_view);
    for (const [id, [start, end]] of Object.entries(limits))
      model(id).setv({ start, end, reset_start: start, reset_end: end }, here);
    for (const [id, line_dash] of Object.entries(dashes)) model(id).setv({ line_dash }, here);
    for (const view of views) {
      view.unpause(true);
      if (!view._invalidate_all && !view._invalidated_painters.size) continue;
      if (away.has(view.el)) behind.add(view); else view.repaint();
    }
    clearTimeout(later);
    if (behind.size) later = setTimeout(catch_up, 300);
  }
  function catch_up() {
    for (const view of behind) view.repaint();
    behind.clear();
  }

  const seen = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) {
      if (isIntersecting) away.delete(target); else away.add(target);
      for (const view of behind) if (isIntersecting && view.el === target) { behind.delete(view); view.repaint(); }
    }
  });
  addEventListener("beforeprint", catch_up);

  function figures() {
    const views = Bokeh.index.roots.filter((view) => typeof view.repaint === "function");
    for (const { el } of views) if (!known.has(el)) { known.add(el); seen.observe(el); }
    return views;
  }
  return { quicken, draw };
})();
