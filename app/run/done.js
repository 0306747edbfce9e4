// The title of the page: the model's name; while it is in the back, what has ended there meanwhile.
(() => {
  const LONG = 2000; // [ms] who waits that long looks elsewhere
  const plain = () => [pgraph.latest.toolbar?.name, "Pgraph"].filter(Boolean).join(" – ");
  let told = "";

  // A run that plays before the eyes of who asked for it shows by itself that it has ended.
  function watch(topic, said, plays = false) {
    let since = null;
    pgraph.on(topic, (data) => {
      if (data.job !== null) { since ??= performance.now(); return; }
      const took = since === null ? 0 : performance.now() - since;
      since = null;
      const watched = plays && !data.problem && document.hasFocus();
      if (took && (document.hidden || (took > LONG && !watched))) tell(data.problem || said(data), !data.problem);
    });
  }

  function tell(text, good) {
    pgraph.toast(text, good);
    if (document.hidden || !document.hasFocus()) told = `${good ? "✓" : "✗"} ${text} – `;
    title();
  }

  function title() { document.title = told + plain(); }
  function seen() { if (!document.hidden) { told = ""; title(); } }
  document.addEventListener("visibilitychange", seen);
  window.addEventListener("focus", seen);

  pgraph.on("toolbar", title);
  watch("run", (data) => `Computed: ${data.trust.said}`, true);
  watch("reports", (data) => { const title = data.results?.[0]?.title ?? "the report"; return title.endsWith("cancelled") ? title : `Ready: ${title}`; });
})();
