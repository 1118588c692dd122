// A table that scrolls sideways can be scrolled with the keyboard, too.
new MutationObserver(() => {
  for (const wrap of document.querySelectorAll(".md-typeset__scrollwrap:not([tabindex])")) wrap.tabIndex = 0;
}).observe(document.documentElement, { childList: true, subtree: true });

// A picture opens by itself, so that its words can be read on a small screen.
document.addEventListener("click", (event) => {
  if (event.target.matches(".md-typeset :not(a) > img")) location.assign(event.target.src);
});
