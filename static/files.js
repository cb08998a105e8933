// @ts-check
// What leaves the page as a file, and scenes that come as one.
import { Problem, request, session, sessionAddress } from "./api.js";
import { byId, download, h } from "./dom.js";
import { toast } from "./notices.js";

/** @param {unknown} error */
export function complain(error) {
  const where = error instanceof Problem && error.path ? `${error.path}: ` : "";
  toast(where + (error instanceof Error ? error.message : String(error)), "error");
}

/** Today's date and time for a file's name. */
export function stamp() {
  return new Date().toISOString().slice(0, 19).replaceAll(/[-:]/g, "").replace("T", "-");
}

/** Renders a still on the server by the form's choices, and saves it. @param {HTMLFormElement} form */
export function offerStills(form) {
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    const button = form.querySelector("button");
    const choices = new FormData(form);
    const url = sessionAddress("frame");
    for (const [name, value] of choices) url.searchParams.set(name, String(value));
    button?.setAttribute("aria-busy", "true");
    if (button) button.disabled = true;
    try {
      toast("The server renders the picture.");
      download(await (await request(url)).blob(), `tyndall-${stamp()}.${choices.get("format")}`);
    } catch (error) {
      complain(error);
    } finally {
      button?.removeAttribute("aria-busy");
      if (button) button.disabled = false;
    }
  });
}

/** Saves a volume's density. @param {string} volume @param {"nrrd" | "npy"} format */
export async function exportVolume(volume, format) {
  const url = sessionAddress("export");
  for (const [name, value] of Object.entries({ volume, field: "density", format })) url.searchParams.set(name, value);
  try {
    download(await (await request(url)).blob(), `${session}-${volume}.${format}`);
  } catch (error) {
    complain(error);
  }
}

/**
 * Opens scene files from the picker and from drag and drop.
 * @param {HTMLInputElement} input @param {(scene: import("./protocol.js").JsonObject) => Promise<boolean>} replace
 */
export function acceptScenes(input, replace) {
  /** @param {File | undefined} file */
  const open = async (file) => {
    if (!file) return;
    try {
      if (await replace(JSON.parse(await file.text()))) toast(`${file.name} is open.`);
    } catch (error) {
      complain(new Error(`${file.name} is not JSON: ${error instanceof Error ? error.message : error}`));
    }
  };
  input.addEventListener("change", () => {
    open(input.files?.[0]);
    input.value = "";
  });
  addEventListener("dragover", (event) => event.preventDefault());
  addEventListener("drop", (event) => {
    event.preventDefault();
    open(event.dataTransfer?.files[0]);
  });
}

/** Fills the list of facts about the server. @param {import("./protocol.js").Info} info */
export function describeServer(info) {
  /** @type {[string, string | undefined][]} */
  const facts = [["Version", info.version], ["Adapter", info.adapter?.name], ["Backend", info.adapter?.backend], ["Type", info.adapter?.type], ["Session", session]];
  byId("about", HTMLElement).replaceChildren(...facts.flatMap(([name, text]) => (text ? [h("div", {}, h("dt", {}, name), h("dd", {}, String(text)))] : [])));
}
