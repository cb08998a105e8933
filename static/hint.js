// @ts-check
// What a parameter means, shown beside its row: on hover, on keyboard focus, on a tap on its name.
import { h } from "./dom.js";

const DELAY = 450;

/** @param {HTMLElement} panel an element whose rows carry `data-hint` */
export function showHints(panel) {
  const bubble = h("div", { class: "hint", role: "tooltip", hidden: true });
  document.body.append(bubble);
  /** @type {ReturnType<typeof setTimeout> | undefined} */
  let timer;
  /** @type {Element | null} */
  let shown = null;

  /** @param {Element} row */
  const show = (row) => {
    const text = row.getAttribute("data-hint");
    if (!text) return;
    bubble.textContent = text;
    bubble.hidden = false;
    shown = row;
    const at = row.getBoundingClientRect();
    const own = bubble.getBoundingClientRect();
    // Left of the panel where there is room, else under the row.
    const beside = at.left - own.width - 20;
    bubble.style.left = `${beside > 8 ? beside : Math.max(8, Math.min(at.left, innerWidth - own.width - 8))}px`;
    bubble.style.top = `${Math.min(beside > 8 ? at.top - 4 : at.bottom + 4, innerHeight - own.height - 8)}px`;
  };
  const hide = () => {
    clearTimeout(timer);
    bubble.hidden = true;
    shown = null;
  };
  /** @param {Event} event */
  const rowOf = (event) => (event.target instanceof Element ? event.target.closest("[data-hint]") : null);

  panel.addEventListener("pointerover", (event) => {
    const name = event.target instanceof Element && event.target.closest(".name");
    const row = rowOf(event);
    if (!name || !row || row === shown || event.pointerType !== "mouse") return;
    clearTimeout(timer);
    timer = setTimeout(() => show(row), DELAY);
  });
  panel.addEventListener("pointerout", (event) => {
    const into = event.relatedTarget;
    if (into instanceof Element && (into === bubble || into.closest("[data-hint]") === shown)) return;
    hide();
  });
  bubble.addEventListener("pointerleave", hide);
  panel.addEventListener("focusin", (event) => {
    const row = rowOf(event);
    if (row && event.target instanceof Element && event.target.matches(":focus-visible")) show(row);
  });
  panel.addEventListener("focusout", hide);
  panel.addEventListener("pointerup", (event) => {
    const row = rowOf(event);
    if (event.pointerType !== "mouse" && row && event.target instanceof Element && event.target.closest(".name")) show(row);
  });
  panel.addEventListener("scroll", hide, { passive: true });
  addEventListener("keydown", (event) => event.key === "Escape" && hide());
  addEventListener("pointerdown", hide);
}
