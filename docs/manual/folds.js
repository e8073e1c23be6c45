// Tables that are closed: a link to the heading of one opens it, a button opens all of them, and paper has all open.
(() => {
  const folds = () => [...document.querySelectorAll("article details")];
  const linked = () => {
    const name = decodeURIComponent(location.hash.slice(1)), heading = name && document.getElementById(name);
    let next = heading && /^H\d$/.test(heading.tagName) ? heading.nextElementSibling : null;
    while (next && !/^H\d$/.test(next.tagName)) {
      if (next.tagName === "DETAILS") next.open = true;
      next = next.nextElementSibling;
    }
    if (heading) heading.scrollIntoView();
  };
  const begin = () => {
    if (folds().length < 5) return;
    const button = document.createElement("button");
    button.className = "md-button open-all";
    button.textContent = "Open all tables";
    button.onclick = () => {
      const open = folds().some((fold) => !fold.open);
      for (const fold of folds()) fold.open = open;
      button.textContent = open ? "Close all tables" : "Open all tables";
    };
    folds()[0].closest("article").querySelector("h1").after(button);
    linked();
  };
  addEventListener("hashchange", linked);
  addEventListener("beforeprint", () => { for (const fold of folds()) fold.open = true; });
  document.readyState === "loading" ? addEventListener("DOMContentLoaded", begin) : begin();
})();
