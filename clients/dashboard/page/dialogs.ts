// Forms that change something; a refusal is shown in the form, with the field that the server names.
import { Refused } from "./api";
import { h } from "./dom";

export interface Field {
  name: string;
  label: string;
  value?: string;
  options?: string[];
  type?: "text" | "number" | "file";
  hint?: string;
}

export function explain(error: unknown): string {
  if (error instanceof Refused && error.fields.length) {
    return error.fields.map(({ field, description }) => `${field}: ${description}`).join("\n");
  }
  return error instanceof Error ? error.message : String(error);
}

export function ask(title: string, fields: Field[], submit: string, act: (form: FormData) => Promise<void>): void {
  const problem = h("p", { class: "problem", role: "alert", hidden: true });
  const send = h("button", { type: "submit", class: "primary" }, submit);
  const form = h("form", { method: "dialog" }, h("h2", { id: "dialog-title" }, title));
  for (const field of fields) {
    const input = field.options
      ? h("select", { name: field.name }, ...field.options.map((option) => h("option", { value: option, selected: option === field.value }, option)))
      : h("input", { name: field.name, type: field.type ?? "text", value: field.type === "file" ? undefined : (field.value ?? ""), step: "any" });
    form.append(h("label", {}, h("span", {}, field.label), input, field.hint ? h("small", {}, field.hint) : null));
  }
  form.append(problem, h("div", { class: "buttons" }, h("button", { type: "button", click: () => dialog.close() }, "Cancel"), send));
  const dialog = h("dialog", { "aria-labelledby": "dialog-title" }, form);
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    send.disabled = true;
    problem.hidden = true;
    try {
      await act(new FormData(form));
      dialog.close();
    } catch (error) {
      problem.textContent = explain(error);
      problem.hidden = false;
    }
    send.disabled = false;
  });
  dialog.addEventListener("close", () => dialog.remove());
  document.body.append(dialog);
  dialog.showModal();
}
