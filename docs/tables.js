// A table that scrolls sideways can be scrolled with the keyboard, too.
new MutationObserver(() => {
  for (const wrap of document.querySelectorAll(".md-typeset__scrollwrap:not([tabindex])")) wrap.tabIndex = 0;
}).observe(document.documentElement, { childList: true, subtree: true });

// A picture opens by itself, so that its words can be read on a small screen.
document.addEventListener("click", (event) => {
  if (event.target.matches(".md-typeset :not(a) > img")) location.assign(event.target.src);
});

// A line breaks between the words of code, not within one: "--fields" stays whole.
for (const code of document.querySelectorAll(".md-typeset :not(pre) > code")) {
  if (code.childElementCount) continue;
  const words = code.textContent.split(/( )/).map((word) => {
    const whole = document.createElement("span");
    whole.className = word !== " " && word.length < 32 ? "whole" : "";
    whole.textContent = word;
    return whole;
  });
  code.replaceChildren(...words);
}
