/** A page of the dashboard: an element, which is told when it is left. */
export interface Page {
  element: HTMLElement;
  title: string;
  close(): void;
}
