// State shared by all plots: the time range, the lines shown, the scale, and the cursor.
class LinkedPlots {
  constructor(plots) {
    this.plots = plots;
    this.view = { range: [...report.span], looks: { hiddenRuns: new Set(), logarithmic: false } };
    this.stale = new Set();
    this.visible = new Set();
    this.watch = new IntersectionObserver((entries) => this.seen(entries), { rootMargin: "200px" });
  }

  async draw() {
    for (const plot of this.plots) {
      await plot.draw(this.view);
      this.listen(plot);
      this.watch.observe(plot.frame);
    }
  }

  listen(plot) {
    plot.frame.on("plotly_relayout", (change) => {
      const range = [change["xaxis.range[0]"], change["xaxis.range[1]"]];
      if (range[0] !== undefined) this.zoom(range.map(Number));
    });
    plot.frame.on("plotly_doubleclick", () => this.zoom(report.span));
    plot.frame.addEventListener("pointermove", (event) => this.point(plot, this.timeOf(plot, event)));
    plot.frame.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && this.point(plot, null));
    plot.frame.addEventListener("click", (event) => this.seek(this.timeOf(plot, event)));
  }

  timeOf(plot, event) {
    const time = plot.timeAt(event.clientX - plot.frame.getBoundingClientRect().left);
    return Math.min(Math.max(time, this.view.range[0]), this.view.range[1]);
  }

  // All visible plots show their values at the time under the pointer; once per frame is enough.
  point(source, time) {
    this.pointed ??= requestAnimationFrame(() => {
      this.pointed = undefined;
      this.showTime(this.wanted.time ?? this.chosen ?? null);
      for (const plot of this.visible) if (plot !== this.wanted.source) plot.showValues(this.wanted.time);
    });
    this.wanted = { source, time };
  }

  // Select a time: the plots mark it while the pointer is elsewhere, and the animation goes there.
  seek(time) {
    this.chosen = time;
    this.onSeek?.(time);
    this.showTime(time);
  }

  showTime(time) {
    for (const plot of this.plots) plot.showCursor(time);
    this.onTime?.(time);
  }

  zoom([begin, end]) {
    const [first, last] = report.span;
    const range = [Math.max(begin, first), Math.min(end, last)];
    if (!(range[1] > range[0])) return;
    this.change({ ...this.view, range });
    this.onZoom?.(range);
  }

  // Everything but the range: what is hidden, the scale, the colours.
  restyle(looks) {
    this.change({ ...this.view, looks: { ...this.view.looks, ...looks } });
  }

  // Visible plots are drawn first.
  change(view) {
    this.view = view;
    this.stale = new Set(this.plots);
    this.work ??= this.refresh();
  }

  async refresh() {
    while (this.stale.size > 0) {
      const next = [...this.stale].find((plot) => this.visible.has(plot)) ?? [...this.stale][0];
      this.stale.delete(next);
      await next.update(this.view);
      await new Promise((resolve) => requestAnimationFrame(resolve));
    }
    this.work = undefined;
  }

  seen(entries) {
    for (const entry of entries) {
      const plot = this.plots.find((one) => one.frame === entry.target);
      if (entry.isIntersecting) this.visible.add(plot);
      else this.visible.delete(plot);
    }
  }
}
