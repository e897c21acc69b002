let timer: ReturnType<typeof setTimeout> | undefined;

onmessage = ({ data }: MessageEvent<number>) => {
  clearTimeout(timer);
  timer = setTimeout(() => postMessage(null), data);
};
