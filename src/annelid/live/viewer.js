// Dark scheme, sharp lines, keys and clips, around viser's own page. Loads nothing and sends nothing.
"use strict";
(() => {
  const dark = matchMedia("(prefers-color-scheme: dark)").matches;
  document.documentElement.classList.toggle("dark", dark);
  // Viser reads these from the address; without the second it blurs the scene where a computer is slow.
  const wanted = new URLSearchParams(location.search);
  if (dark) wanted.set("darkMode", "");
  if (!wanted.has("fixedDpr")) wanted.set("fixedDpr", String(Math.min(devicePixelRatio, 2)));
  history.replaceState(null, "", `?${wanted}${location.hash}`);

  const element = (tag, text, into, attributes = {}) => {
    const made = document.createElement(tag);
    made.textContent = text;
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    into.append(made);
    return made;
  };
  const button = (label) => [...document.querySelectorAll("#root button")].find((one) => one.textContent === label);

  // Viser's sliders, their fields and two of its buttons have no names for those who hear the page.
  function name() {
    for (const label of document.querySelectorAll("#root label[for]")) {
      const row = label.parentElement.parentElement.parentElement;
      for (const one of row.querySelectorAll("[role=slider], input")) one.setAttribute("aria-label", label.textContent);
    }
    for (const one of document.querySelectorAll("#root button:not([aria-label])")) {
      if (one.textContent.trim()) continue;
      one.setAttribute("aria-label", one.className.includes("closeButton") ? "Close the notice" : "Connection and scene");
    }
  }

  const clip = { recorder: null };
  function startClip() {
    const scene = document.querySelector("#root canvas[data-engine]");
    const type = ["video/webm", "video/mp4"].find((one) => MediaRecorder.isTypeSupported(one));
    if (!scene || !type) return;
    // The scene is transparent: a video needs the background, too.
    const copy = document.createElement("canvas");
    const paper = copy.getContext("2d");
    [copy.width, copy.height] = [scene.width, scene.height];
    const paint = () => {
      paper.fillStyle = getComputedStyle(scene).backgroundColor;
      paper.fillRect(0, 0, copy.width, copy.height);
      paper.drawImage(scene, 0, 0, copy.width, copy.height);
    };
    paint();
    const painting = setInterval(paint, 1000 / 30);
    const parts = [];
    clip.recorder = new MediaRecorder(copy.captureStream(30), { mimeType: type, videoBitsPerSecond: 8e6 });
    clip.recorder.ondataavailable = (event) => parts.push(event.data);
    clip.recorder.onstop = () => {
      clearInterval(painting);
      const address = URL.createObjectURL(new Blob(parts, { type }));
      const link = element("a", "", document.body, { href: address, download: `annelid.${type.slice(6)}` });
      link.click();
      link.remove();
      setTimeout(() => URL.revokeObjectURL(address), 10000);
      clip.recorder = null;
      showClip();
    };
    clip.recorder.start();
    showClip();
  }
  function showClip() {
    clip.button.textContent = clip.recorder ? "Stop and save" : "Record clip";
    clip.button.setAttribute("aria-pressed", String(clip.recorder !== null));
  }
  const toggleClip = () => (clip.recorder ? clip.recorder.stop() : startClip());

  let help;
  function toggleHelp() {
    if (help.open) return help.close();
    // A recorded run has fewer buttons than a live worm.
    for (const row of help.querySelectorAll("[data-button]")) row.hidden = !button(row.dataset.button);
    help.showModal();
  }
  // By key: how it is called, what it does, and which button it presses or what it calls.
  const KEYS = {
    " ": ["Space", "play or pause", "Play / pause"],
    l: ["L", "live: go to the present and on from there", "Live"],
    r: ["R", "restart at time zero", "Restart"],
    x: ["X", "reset the sliders", "Reset sliders"],
    c: ["C", "record a clip; again to save it", toggleClip],
    "?": ["?", "show or hide this list", toggleHelp],
  };

  document.addEventListener("DOMContentLoaded", () => {
    let due;
    const soon = () => (due ??= setTimeout(() => ((due = undefined), name()), 300));
    new MutationObserver(soon).observe(document.getElementById("root"), { childList: true, subtree: true });
    const bar = element("div", "", document.body, { class: "annelid-bar", role: "toolbar", "aria-label": "Scene" });
    clip.button = element("button", "", bar, { type: "button" });
    clip.button.onclick = toggleClip;
    showClip();
    element("button", "Keys", bar, { type: "button" }).onclick = toggleHelp;
    help = element("dialog", "", document.body, { class: "annelid-help", "aria-labelledby": "annelid-keys" });
    element("h2", "Keys and mouse", help, { id: "annelid-keys" });
    const table = element("table", "", help);
    const rows = [
      ...Object.values(KEYS),
      ["Left button", "turn the view"],
      ["Right button", "shift the view"],
      ["Wheel", "zoom"],
      ["Click on the worm", "poke it, if it is live"],
    ];
    for (const [key, meaning, act] of rows) {
      const row = element("tr", "", table, typeof act === "string" ? { "data-button": act } : {});
      element("kbd", key, element("td", "", row));
      element("td", meaning, row);
    }
    element("button", "Close", help, { type: "button" }).onclick = toggleHelp;
  });
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat) return;
    // Where text is typed every key has its meaning; a button in focus takes the space bar itself.
    const own = event.key === " " ? "input, textarea, select, button" : "input:not([type=checkbox]), textarea, select";
    if (event.target.closest(own)) return;
    const act = KEYS[event.key.toLowerCase()]?.[2];
    typeof act === "string" ? button(act)?.click() : act?.();
  });
})();
