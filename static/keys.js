// @ts-check
// Keyboard shortcuts, and the switch that turns the single keys off.

const KEY = "tyndall.keys";
const TYPING = "input:not([type=range]), select, textarea, [contenteditable]";
/** Keys that move a slider. */
const SLIDING = /^(?:Home|End|Page|Arrow)/;

/**
 * @typedef {{
 *   axis(number: 1 | 3 | 7): void, frame(): void, home(): void, bookmark(): void, recall(number: number): void,
 *   toggle(): void, step(): void, picture(): void, link(): void, undo(): void, redo(): void, help(): void,
 *   fly(event: KeyboardEvent): boolean,
 * }} Actions
 */

/** @param {Actions} actions @param {HTMLInputElement} box the switch */
export function listen(actions, box) {
  try {
    box.checked = localStorage.getItem(KEY) !== "off";
  } catch {
    box.checked = true;
  }
  box.addEventListener("change", () => {
    try {
      localStorage.setItem(KEY, box.checked ? "on" : "off");
    } catch {
      // Without storage the choice lasts until the page is reloaded.
    }
  });
  addEventListener("keydown", (event) => {
    if (event.defaultPrevented || event.altKey) return;
    const { target } = event;
    if (target instanceof Element && (target.matches(TYPING) || target.closest("dialog"))) return;
    if (target instanceof HTMLInputElement && SLIDING.test(event.key)) return;
    if (event.ctrlKey || event.metaKey ? command(event, actions) : box.checked && single(event, actions)) event.preventDefault();
  });
}

/** @param {KeyboardEvent} event @param {Actions} actions */
function command(event, actions) {
  const key = event.key.toLowerCase();
  if (key === "z") event.shiftKey ? actions.redo() : actions.undo();
  else if (key === "y") actions.redo();
  else return false;
  return true;
}

/** @param {KeyboardEvent} event @param {Actions} actions */
function single(event, actions) {
  const digit = /^(?:Digit|Numpad)([1-9])$/.exec(event.code)?.[1];
  if (digit && event.shiftKey) {
    actions.recall(Number(digit));
    return true;
  }
  if (digit === "1" || digit === "3" || digit === "7") {
    actions.axis(/** @type {1 | 3 | 7} */ (Number(digit)));
    return true;
  }
  if (actions.fly(event)) return true;
  // A button that has the focus keeps its own key.
  const onButton = event.target instanceof Element && event.target.matches("button, a, summary");
  if (event.key === " " && onButton) return false;
  /** @type {Record<string, (() => void) | undefined>} */
  const table = {
    " ": actions.toggle, ".": actions.step, f: actions.frame, home: actions.home, b: actions.bookmark,
    p: actions.picture, l: actions.link, "?": actions.help,
  };
  const action = event.repeat && event.key !== "." ? undefined : table[event.key.toLowerCase()];
  action?.();
  return Boolean(action);
}
