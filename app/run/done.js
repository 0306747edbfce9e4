// The title of the page: the model's name; before it what has ended while the page was in the back.
(() => {
  let told = "";
  const title = () => {
    document.title = told + [pgraph.latest.toolbar?.name, "Pgraph"].filter(Boolean).join(" – ");
  };
  const seen = () => {
    if (!document.hidden) {
      told = "";
      title();
    }
  };

  function watch(topic, said) {
    let busy = false;
    pgraph.on(topic, (data) => {
      const ended = busy && data.job === null;
      busy = data.job !== null;
      if (!ended || (!document.hidden && document.hasFocus())) return;
      told = `${data.problem ? "✗" : "✓"} ${data.problem || said(data)} – `;
      title();
    });
  }
  document.addEventListener("visibilitychange", seen);
  window.addEventListener("focus", seen);

  pgraph.on("toolbar", title);
  watch("run", ({ trust }) => trust.said);
  watch("reports", ({ results }) => results?.[0]?.title ?? "The report");
})();
