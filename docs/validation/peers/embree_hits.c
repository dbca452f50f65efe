/* Closest hits of Embree 4, one ray at a time through its native interface; see embree_peers.py, which compiles and runs it.

   embree_hits FOLDER SCENE RAYS FLAGS REPEATS: prints, as JSON, hits per second of processor time (the median), how many rays hit nothing,
   and the mean distance. FLAGS: 0, or 4 for robust. Declarations are those of embree4/rtcore*.h, of which the package has only the library. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

typedef struct {
    float org_x, org_y, org_z, tnear, dir_x, dir_y, dir_z, time, tfar;
    unsigned mask, id, flags;
    float Ng_x, Ng_y, Ng_z, u, v;
    unsigned primID, geomID, instID[2]; /* the second: instPrimID, where the library was built with arrays of instances */
    unsigned room[8];
} __attribute__((aligned(64))) RayHit;

void *rtcNewDevice(const char *config);
void *rtcNewScene(void *device);
void rtcSetSceneFlags(void *scene, int flags);
void *rtcNewGeometry(void *device, int type);
void *rtcSetNewGeometryBuffer(void *geometry, int type, unsigned slot, int format, size_t stride, size_t count);
void rtcCommitGeometry(void *geometry);
unsigned rtcAttachGeometry(void *scene, void *geometry);
void rtcCommitScene(void *scene);
void rtcIntersect1(void *scene, void *rayhit, void *arguments);

enum { TRIANGLES = 0, BUFFER_INDEX = 0, BUFFER_VERTEX = 1, FORMAT_UINT3 = 0x5003, FORMAT_FLOAT3 = 0x9003 };

static void *contents(const char *folder, const char *name, size_t *bytes) {
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "rb");
    if (!file) { perror(path); exit(1); }
    fseek(file, 0, SEEK_END);
    *bytes = ftell(file);
    rewind(file);
    void *data = malloc(*bytes);
    if (!data || fread(data, 1, *bytes, file) != *bytes) { perror(path); exit(1); }
    fclose(file);
    return data;
}

static int ascending(const void *a, const void *b) {
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

int main(int count, char **arguments) {
    if (count != 6) { fputs("embree_hits FOLDER SCENE RAYS FLAGS REPEATS\n", stderr); return 1; }
    const char *folder = arguments[1];
    char name[4096];
    size_t bytes;
    void *device = rtcNewDevice("threads=1"), *scene = rtcNewScene(device), *geometry = rtcNewGeometry(device, TRIANGLES);
    rtcSetSceneFlags(scene, atoi(arguments[4]));
    snprintf(name, sizeof name, "%s.vertices.f32", arguments[2]);
    void *data = contents(folder, name, &bytes);
    memcpy(rtcSetNewGeometryBuffer(geometry, BUFFER_VERTEX, 0, FORMAT_FLOAT3, 12, bytes / 12), data, bytes);
    snprintf(name, sizeof name, "%s.triangles.u32", arguments[2]);
    data = contents(folder, name, &bytes);
    memcpy(rtcSetNewGeometryBuffer(geometry, BUFFER_INDEX, 0, FORMAT_UINT3, 12, bytes / 12), data, bytes);
    rtcCommitGeometry(geometry);
    rtcAttachGeometry(scene, geometry);
    rtcCommitScene(scene);
    const float *rays = contents(folder, arguments[3], &bytes);
    size_t total = bytes / 24, lost = 0;
    int repeats = atoi(arguments[5]);
    double *seconds = malloc(repeats * sizeof *seconds), sum = 0;
    for (int repeat = -1; repeat < repeats; repeat++) {
        struct timespec start, end;
        lost = 0, sum = 0;
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &start);
        for (size_t i = 0; i < total; i++) {
            const float *r = rays + 6 * i;
            RayHit hit = {.org_x = r[0], .org_y = r[1], .org_z = r[2], .dir_x = r[3], .dir_y = r[4], .dir_z = r[5]};
            hit.tfar = __builtin_inff();
            hit.mask = hit.geomID = hit.instID[0] = hit.instID[1] = -1;
            rtcIntersect1(scene, &hit, NULL);
            if (hit.geomID == (unsigned)-1) lost++;
            else sum += hit.tfar;
        }
        clock_gettime(CLOCK_THREAD_CPUTIME_ID, &end);
        if (repeat >= 0) seconds[repeat] = (end.tv_sec - start.tv_sec) + 1e-9 * (end.tv_nsec - start.tv_nsec);
    }
    qsort(seconds, repeats, sizeof *seconds, ascending);
    printf("{\"per_s\": %.0f, \"lost\": %zu, \"mean_m\": %.7f}\n", total / seconds[repeats / 2], lost, sum / (total - lost));
    return 0;
}
