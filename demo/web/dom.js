// Makes and finds elements.

export const find = (id) => document.getElementById(id);

/** An element with these properties and children; strings become text, never markup. */
export function make(tag, properties = {}, ...children) {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name in element) element[name] = value;
    else element.setAttribute(name, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

/** Set the text of an element, unless it has it: live regions are read again otherwise. */
export function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

/** Fill a drop-down list with [value, text] pairs, unless it has them. */
export function setOptions(select, pairs) {
  const signature = JSON.stringify(pairs);
  if (select.dataset.options === signature) return;
  select.dataset.options = signature;
  select.replaceChildren(...pairs.map(([value, text]) => make("option", { value }, text)));
}
