"use strict";
// Copy buttons, and folds that open on paper.
(() => {
  for (const box of document.querySelectorAll("[data-tex]")) {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "copy";
    button.textContent = "LaTeX";
    button.title = "Copy as LaTeX";
    button.addEventListener("click", async () => {
      const said = await copied(box.dataset.tex) ? "Copied" : "Not copied";
      button.textContent = said;
      setTimeout(() => { button.textContent = "LaTeX"; }, 1500);
    });
    // An equation and its button stay in one line.
    const line = document.createElement("div");
    line.className = "copied";
    box.replaceWith(line);
    line.append(box, button);
  }

  async function copied(text) {
    try {
      await navigator.clipboard.writeText(text);
      return true;
    } catch {
      // A page that was opened from a file may have no clipboard: an old way is left.
      const area = document.createElement("textarea");
      area.value = text;
      document.body.append(area);
      area.select();
      const done = document.execCommand("copy");
      area.remove();
      return done;
    }
  }

  let opened = [];
  addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open])")];
    opened.forEach((fold) => { fold.open = true; });
  });
  addEventListener("afterprint", () => { opened.forEach((fold) => { fold.open = false; }); });

  // A link into a fold opens it.
  const show = () => {
    const target = location.hash.length > 1 && document.getElementById(decodeURIComponent(location.hash.slice(1)));
    const fold = target && target.closest("details");
    if (fold && !fold.open) { fold.open = true; target.scrollIntoView(); }
  };
  addEventListener("hashchange", show);
  show();

  // The section that is read is marked in the contents.
  const links = new Map([...document.querySelectorAll("nav.contents a")].map((a) => [a.getAttribute("href").slice(1), a]));
  const watch = new IntersectionObserver((entries) => {
    for (const entry of entries) {
      if (!entry.isIntersecting) { continue; }
      links.forEach((a) => { a.removeAttribute("aria-current"); });
      links.get(entry.target.id)?.setAttribute("aria-current", "true");
    }
  }, { rootMargin: "-10% 0px -80% 0px" });
  links.forEach((_, id) => { const part = document.getElementById(id); if (part) { watch.observe(part); } });
})();
