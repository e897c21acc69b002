/* Runs a program, and gives it a console event once FILE exists, in the way in which its console
 * window does; ends with its exit code.
 *
 *   press EVENT FILE PROGRAM ARGUMENTS...
 *
 * EVENT is 0 for Ctrl-C, 1 for Ctrl-Break, 2 for a closed window. */
#include <stdlib.h>
#include <string.h>
#include <windows.h>

int main(int count, char **given) {
    char line[1024] = "";
    for (int at = 3; at < count; at++) {
        if (strlen(line) + strlen(given[at]) + 2 > sizeof line) return 90;
        strcat(strcat(line, given[at]), " ");
    }
    STARTUPINFOA start = {.cb = sizeof start};
    PROCESS_INFORMATION child;
    if (!CreateProcessA(NULL, line, NULL, NULL, TRUE, 0, NULL, NULL, &start, &child)) return 91;
    while (GetFileAttributesA(given[2]) == INVALID_FILE_ATTRIBUTES) Sleep(20);

    /* System libraries are at the same address in all processes. */
    FARPROC routine = GetProcAddress(GetModuleHandleA("kernelbase"), "CtrlRoutine");
    void *event = (void *)(INT_PTR)atoi(given[1]);
    if (!routine || !CreateRemoteThread(child.hProcess, NULL, 0, (LPTHREAD_START_ROUTINE)routine,
                                        event, 0, NULL)) {
        TerminateProcess(child.hProcess, 92);
    }
    DWORD code = 93;
    WaitForSingleObject(child.hProcess, INFINITE);
    GetExitCodeProcess(child.hProcess, &code);
    return (int)code;
}
