# syntax=docker/dockerfile:1
# Build: docker build -t palpate .
# Run:   docker run -p 127.0.0.1:7257:7257 -v palpate:/data palpate

# Node.js 20, which builds the page.
FROM node:20-bookworm-slim AS node

FROM rust:1.95-slim-bookworm AS build
COPY --from=node /usr/local /opt/node
ENV PATH=/opt/node/bin:$PATH
WORKDIR /src
COPY Cargo.toml Cargo.lock ./
COPY migrations migrations
COPY proto proto
COPY core core
COPY clients clients
COPY tests tests
COPY server server
# The caches keep downloads and compiled dependencies between builds; what is shipped is copied out of them.
RUN --mount=type=cache,target=/usr/local/cargo/registry \
    --mount=type=cache,target=/src/target \
    cargo build --locked --profile dist --package palpate --bin palpate \
    && cp target/dist/palpate /usr/local/bin/palpate

FROM debian:bookworm-slim
RUN useradd --uid 10001 --no-create-home --shell /usr/sbin/nologin palpate \
    && install --directory --owner palpate --group palpate /data
COPY --from=build /usr/local/bin/palpate /usr/local/bin/palpate
USER palpate
WORKDIR /data
VOLUME /data
# Inside a container the loopback cannot be published, so all of its addresses are listened on. This version knows no
# callers: --insecure-open accepts that whoever reaches the published port may read and change every session. Publish
# it on 127.0.0.1 only, as above, or behind a proxy that authenticates.
ENV PALPATE_LISTEN=0.0.0.0:7257 PALPATE_DATABASE=/data/palpate.db
EXPOSE 7257
HEALTHCHECK --interval=10s --timeout=3s --start-period=5s \
    CMD ["bash", "-c", "exec 3<>/dev/tcp/127.0.0.1/7257 && printf 'GET /readyz HTTP/1.0\\r\\n\\r\\n' >&3 && head -n 1 <&3 | grep -q ' 200 '"]
ENTRYPOINT ["palpate"]
CMD ["serve", "--insecure-open"]
